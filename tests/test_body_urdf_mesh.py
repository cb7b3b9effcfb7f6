"""Feet that are meshes: the sole is the outline of their lowest layer, in every way in which a file may name the
mesh.
"""

import numpy as np
import pytest
import trimesh
from robots import BOX, biped

from biodance.body.urdf import read_urdf
from biodance.body.urdf_file import CORNERS, match_faces, sole_outline
from biodance.errors import FileRefused
from biodance.motion.kinematics import poses

SOLE = BOX.format(place="0 0 0.01", size="0.22 0.1 0.02")
MESH = (
    '<collision><origin xyz="{xyz}" rpy="{rpy}"/><geometry><mesh filename="{file}" '
    'scale="{scale}"/></geometry></collision>'
)
FEET = ("r_sole", "l_sole")


def shoe():
    """Return a block of 0.22 x 0.1 m with a dome on top, its underside at z = 0; many corners, only four of them on
    the ground.
    """
    dome = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    dome.apply_translation([0.02, 0, 0.05])
    block = trimesh.creation.box(extents=[0.22, 0.1, 0.02])
    block.apply_translation([0, 0, 0.01])
    return trimesh.util.concatenate([block, dome])


def robot(tmp_path, file="sole.stl", *, xyz="0 0 0", rpy="0 0 0", scale="1 1 1"):
    text = biped()
    assert text.count(SOLE) == 2
    (tmp_path / "robot.urdf").write_text(text.replace(SOLE, MESH.format(file=file, xyz=xyz, rpy=rpy, scale=scale)))
    return tmp_path / "robot.urdf"


def soles(body):
    """Return both outlines (P, 3) m at zero angles."""
    pose = poses(body, body.neutral[None])
    return [
        pose.points([body.feet[s].segment] * len(body.feet[s].outline), body.feet[s].outline)[0]
        for s in ("right", "left")
    ]


@pytest.fixture
def boxes(tmp_path):
    (tmp_path / "box").mkdir()
    (tmp_path / "box" / "robot.urdf").write_text(biped())
    return read_urdf(tmp_path / "box" / "robot.urdf", feet=FEET)


@pytest.mark.parametrize("kind", ["stl", "obj", "dae"])
def test_a_mesh_with_the_underside_of_a_box_has_the_sole_of_the_box(kind, boxes, tmp_path):
    shoe().export(tmp_path / f"sole.{kind}")
    body = read_urdf(robot(tmp_path, f"sole.{kind}"), feet=FEET)
    for ours, theirs in zip(soles(body), soles(boxes), strict=True):
        assert len(ours) == 4
        np.testing.assert_allclose(np.sort(ours, axis=0), np.sort(theirs, axis=0), atol=1e-6)
        edges = np.roll(ours, -1, axis=0) - ours
        assert np.all(np.cross(edges, np.roll(edges, -1, axis=0))[:, 2] > 0)  # counter-clockwise from above


def test_the_mesh_is_placed_turned_and_scaled(boxes, tmp_path):
    mesh = shoe()
    mesh.apply_scale(1000.0)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    mesh.apply_translation([0, 30.0, 0])
    mesh.export(tmp_path / "sole.stl")
    path = robot(tmp_path, xyz="0 0 -0.03", rpy="1.5707963267948966 0 0", scale="0.001 0.001 0.001")
    for ours, theirs in zip(soles(read_urdf(path, feet=FEET)), soles(boxes), strict=True):
        np.testing.assert_allclose(np.sort(ours, axis=0), np.sort(theirs, axis=0), atol=1e-6)


@pytest.mark.parametrize(
    "name", ["package://biped/meshes/sole.stl", "../meshes/sole.stl", "package://robots/biped/meshes/sole.stl"]
)
def test_files_are_found_as_ros_names_them(name, tmp_path):
    (tmp_path / "robots" / "biped" / "urdf").mkdir(parents=True)
    (tmp_path / "robots" / "biped" / "meshes").mkdir()
    shoe().export(tmp_path / "robots" / "biped" / "meshes" / "sole.stl")
    body = read_urdf(robot(tmp_path / "robots" / "biped" / "urdf", name), feet=FEET)
    assert len(body.feet["right"].outline) == 4


def test_a_mesh_that_is_missing_or_damaged_is_named(tmp_path):
    with pytest.raises(
        FileRefused, match=r"r_pad shows no sole, since of its meshes the mesh 'sole\.stl' is not where"
    ):
        read_urdf(robot(tmp_path), feet=FEET)
    with pytest.raises(FileRefused, match=r"since of its meshes the mesh 'x+\.stl' is not where"):
        read_urdf(robot(tmp_path, "x" * 5000 + ".stl"), feet=FEET)
    (tmp_path / "sole.obj").write_text("not a mesh")
    with pytest.raises(FileRefused, match=r"r_pad shows no sole, since of its meshes .*sole\.obj"):
        read_urdf(robot(tmp_path, "sole.obj"), feet=FEET)


def test_a_mesh_that_stands_on_a_point_or_on_a_side_is_refused(tmp_path):
    cone = trimesh.creation.cone(radius=0.05, height=0.2)
    cone.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    cone.export(tmp_path / "sole.stl")
    with pytest.raises(FileRefused, match="Give it a collision <box>"):
        read_urdf(robot(tmp_path), feet=FEET)


def test_a_round_sole_keeps_few_corners_and_all_on_its_rim():
    disc = trimesh.creation.cylinder(radius=0.08, height=0.02, sections=90)
    axes = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    outline = sole_outline("disc", [], [np.array(disc.vertices)], axes)
    assert len(outline) == CORNERS
    np.testing.assert_allclose(np.linalg.norm(outline[:, :2], axis=1), 0.08)
    (x, y), (following_x, following_y) = outline[:, :2].T, np.roll(outline[:, :2], -1, axis=0).T
    area = 0.5 * abs(np.sum(x * following_y - y * following_x))
    assert area > 0.94 * np.pi * 0.08**2  # twelve regular corners cover 0.955 of the circle


def test_two_soles_get_equally_many_points():
    triangle, square = (
        np.array([[0, 0, 0], [4, 0, 0], [0, 1, 0.0]]),
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]),
    )
    one, other = match_faces(triangle, square)
    np.testing.assert_array_equal(other, square)
    np.testing.assert_array_equal(one, [[0, 0, 0], [4, 0, 0], [2, 0.5, 0], [0, 1, 0]])


def test_a_root_that_faces_backwards_is_turned(boxes, tmp_path):
    """A robot whose file has x backwards is the same robot, seen from its own front."""
    text = biped()
    turned = text.replace("<robot", "<robot", 1)
    names = str.maketrans({})
    for one, other in (('"r_', '"R#'), ('"l_', '"r_'), ('"R#', '"l_')):
        turned = turned.replace(one, other)
    assert turned.translate(names) != text
    (tmp_path / "robot.urdf").write_text(turned)
    body = read_urdf(tmp_path / "robot.urdf", feet=FEET)
    right, left = soles(body)
    assert right[:, 1].mean() < 0 < left[:, 1].mean()
    theirs = soles(boxes)[1] * [-1, -1, 1]  # what was the left foot is the right one, half a turn away
    np.testing.assert_allclose(np.sort(right, axis=0), np.sort(theirs, axis=0), atol=1e-9)


def test_a_point_mass_is_not_known_exactly(tmp_path):
    text = biped()
    one = text.index("<inertia ixx")
    two = text.index("/>", one) + 2
    (tmp_path / "robot.urdf").write_text(
        text[:one] + '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>' + text[two:]
    )
    body = read_urdf(tmp_path / "robot.urdf", feet=FEET)
    sd = np.sqrt(np.diag(body.sip.covariance)).reshape(-1, 10)
    assert np.isfinite(sd).all()
    assert (sd[:, 1:4] > 0).all()
    assert any("Point masses in the file" in note for note in body.notes)
