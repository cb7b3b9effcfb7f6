"""Meshes of segments: what a closed mesh weighs is what its formula says; they reach GLB and OpenSim whole; hulls
hold their points.
"""

import io
import json

import numpy as np
import pytest
import trimesh

from biodance.body.export import write_model
from biodance.body.human.human import human
from biodance.body.inertia import RigidInertia
from biodance.body.solids import box_solid, mesh_lump, read_mesh, segment_solids
from biodance.errors import BiodanceError, FileRefused
from biodance.motion.kinematics import poses
from biodance.records import Subject

MAN = human(Subject(70.0, 1.75, "M", 30.0))
DENSITY = 1040.0


def turned(mesh, place=(0.3, -0.2, 0.5)):
    """Return the mesh turned and moved, and the rotation."""
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, -1], None)
    turn[:3, 3] = place
    mesh.apply_transform(turn)
    return mesh, turn[:3, :3]


def test_a_box_weighs_what_its_formula_says():
    x, y, z = 0.1, 0.4, 0.25
    mesh, turn = turned(trimesh.creation.box(extents=[x, y, z]))
    lump, mass = mesh_lump(mesh, density=DENSITY), DENSITY * x * y * z
    inertia = mass / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
    assert lump.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(lump.com, [0.3, -0.2, 0.5], atol=1e-12)
    np.testing.assert_allclose(lump.inertia, turn @ inertia @ turn.T, atol=1e-12)


def test_a_tetrahedron_weighs_what_its_formula_says():
    """Corners at the origin and at a on each axis: volume a³/6, centre a/4, inertia about the origin m a²/5 and
    product m a²/20.
    """
    a = 0.3
    corners = np.vstack([np.zeros(3), a * np.eye(3)])
    mesh = trimesh.Trimesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    lump, mass = mesh_lump(mesh, density=DENSITY), DENSITY * a**3 / 6
    centre = np.full(3, a / 4)
    about_origin = mass * a**2 / 20 * (5 * np.eye(3) - np.ones((3, 3)))
    expected = about_origin - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    assert lump.mass == pytest.approx(mass)
    np.testing.assert_allclose(lump.com, centre)
    np.testing.assert_allclose(lump.inertia, expected, atol=1e-12)


def test_a_mesh_inside_out_is_the_same_solid():
    mesh, _ = turned(trimesh.creation.box(extents=[0.1, 0.2, 0.3]))
    right = mesh_lump(mesh, density=DENSITY)
    mesh.invert()
    wrong: RigidInertia = mesh_lump(mesh, density=DENSITY)
    assert wrong.mass == pytest.approx(right.mass)
    np.testing.assert_allclose(wrong.inertia, right.inertia, atol=1e-12)


def test_what_encloses_nothing_weighs_nothing():
    mesh = trimesh.creation.box()
    with pytest.raises(BiodanceError, match="density of -1"):
        mesh_lump(mesh, density=-1.0)
    with pytest.raises(BiodanceError, match="not closed"):
        mesh_lump(trimesh.Trimesh(mesh.vertices, mesh.faces[:-1]), density=DENSITY)
    faces = np.array(mesh.faces)
    faces[0] = faces[0][::-1]
    with pytest.raises(BiodanceError, match="different ways"):
        mesh_lump(trimesh.Trimesh(mesh.vertices, faces), density=DENSITY)


def test_the_solid_of_a_box_touches_its_six_faces_and_is_closed():
    box = np.array([[-0.05, -0.4, -0.06], [0.07, 0.0, 0.04]])
    solid = box_solid(box)
    np.testing.assert_allclose(solid.bounds, box, atol=1e-12)
    assert solid.is_watertight
    assert (
        0.78 * np.prod(box[1] - box[0]) < solid.volume < np.prod(box[1] - box[0])
    )  # the exact superellipsoid of exponent 4: 0.8097


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "off", "glb", "dae"])
def test_meshes_are_read_in_metres(kind, tmp_path):
    mesh = trimesh.creation.box(extents=[100, 200, 300])
    mesh.export(tmp_path / f"a.{kind}")
    read = read_mesh(tmp_path / f"a.{kind}", scale=0.001)
    np.testing.assert_allclose(read.extents, [0.1, 0.2, 0.3], rtol=1e-6)
    assert mesh_lump(read, density=1000.0).mass == pytest.approx(6.0, rel=1e-5)


def test_what_is_no_mesh_is_refused(tmp_path):
    (tmp_path / "a.stl").write_bytes(b"solid nothing\nendsolid")
    (tmp_path / "b.obj").write_bytes(b"\x00\xff" * 40)
    for name, said in (("a.stl", "a.stl"), ("b.obj", "b.obj"), ("c.stl", "no such file"), ("d.step", "Legal are .stl")):
        with pytest.raises(FileRefused, match=said):
            read_mesh(tmp_path / name)


def test_meshes_by_name_take_the_place_of_boxes(tmp_path):
    trimesh.creation.box(extents=[0.1, 0.3, 0.1]).export(tmp_path / "left_thigh.stl")
    solids = segment_solids(MAN, tmp_path)
    np.testing.assert_allclose(solids["left_thigh"].extents, [0.1, 0.3, 0.1])
    np.testing.assert_allclose(solids["right_thigh"].bounds, MAN.boxes[MAN.segment_index("right_thigh")], atol=1e-12)
    assert set(solids) == set(MAN.segments)
    trimesh.creation.box().export(tmp_path / "thigh.stl")
    with pytest.raises(FileRefused, match=r"thigh\.stl: is named like no segment"):
        segment_solids(MAN, tmp_path)


def test_glb_shows_every_segment_and_marker_where_it_is(tmp_path):
    path = write_model(MAN, tmp_path / "man.glb", format="glb", source="The table.")
    scene = trimesh.load(io.BytesIO(path.read_bytes()), file_type="glb")
    pose = poses(MAN, np.concatenate([np.zeros(3), [0, 0, 0, 1], np.zeros(23)])[None])  # ISB axes: y up, as in glTF
    for i, name in enumerate(MAN.segments):
        place, mesh = scene.graph[name]
        np.testing.assert_allclose(place[:3, 3], pose.position[0, i], atol=1e-6)
        np.testing.assert_allclose(place[:3, :3], pose.rotation[0, i], atol=1e-6)
        np.testing.assert_allclose(scene.geometry[mesh].bounds, MAN.boxes[i], atol=1e-6)
        assert scene.geometry[mesh].is_watertight
    places = pose.points(list(MAN.markers.segment), MAN.markers.position)[0]
    for name, place in zip(MAN.markers.names, places, strict=True):
        np.testing.assert_allclose(scene.graph[name][0][:3, 3], place, atol=1e-6)
    assert "The table." in json.dumps(scene.metadata)


def test_opensim_finds_the_meshes_beside_the_model(tmp_path):
    solids = segment_solids(MAN)
    path = write_model(MAN, tmp_path / "man.osim", format="osim", solids=solids)
    files = sorted((tmp_path / "Geometry").iterdir())
    assert len(files) == len(MAN.segments)
    np.testing.assert_allclose(
        read_mesh(files[0]).extents, solids[files[0].stem.removeprefix(f"{MAN.name}_")].extents, rtol=1e-5
    )
    named = [f.name for f in files if f"<mesh_file>{f.name}</mesh_file>" in path.read_text()]
    assert len(named) == len(files)
    opensim = pytest.importorskip("opensim", reason="OpenSim is not installed")
    opensim.Logger.setLevelString("off")
    model = opensim.Model(str(path))
    model.initSystem()
    mesh = opensim.Mesh.safeDownCast(model.getBodySet().get("left_thigh").get_attached_geometry(0))
    assert mesh.get_mesh_file() == f"{MAN.name}_left_thigh.stl"


def test_geometry_that_is_there_is_kept_or_refused(tmp_path):
    solids = segment_solids(MAN)
    write_model(MAN, tmp_path / "a.osim", format="osim", solids=solids)
    write_model(MAN, tmp_path / "b.osim", format="osim", solids=solids)  # the same meshes serve both
    solids["left_foot"] = box_solid(np.array([[0, 0, 0], [1, 1, 1]]))
    with pytest.raises(FileRefused, match=r"left_foot\.stl: exists already"):
        write_model(MAN, tmp_path / "c.osim", format="osim", solids=solids)


def test_formats_without_shapes_say_so(tmp_path):
    with pytest.raises(BiodanceError, match="csv shows no meshes"):
        write_model(MAN, tmp_path / "a.csv", format="csv", solids=segment_solids(MAN))
    assert not (tmp_path / "a.csv").exists()


def test_the_import_of_a_body_needs_no_mesh_library():
    import subprocess
    import sys

    code = "import sys, biodance.cli, biodance.body.body, biodance.body.export; sys.exit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
