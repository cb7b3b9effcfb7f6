"""Meshes of segments: solids fill their boxes, files are read in metres; they reach GLB and OpenSim whole."""

import io
import json

import numpy as np
import pytest
import trimesh

from biodance.body.export import write_model
from biodance.body.human.human import human
from biodance.body.solids import box_solid, read_mesh, segment_solids
from biodance.errors import BiodanceError, FileRefused
from biodance.motion.kinematics import poses
from biodance.records import Subject

MAN = human(Subject(70.0, 1.75, "M", 30.0))


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
    assert read.volume == pytest.approx(0.006, rel=1e-5)


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
