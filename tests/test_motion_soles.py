"""Soles and what lies under them: from heel and toe markers, inside a plate, beside a hull."""

import numpy as np
import pytest

from biodance.lab.markers.sets import read_marker_set
from biodance.motion.soles import distance_to_hull, inside, soles_from_markers
from biodance.records import Markers, Plate, Wrench


@pytest.mark.parametrize("turn", [0.0, 0.7, 3.0])
@pytest.mark.parametrize("order", [1, -1])
def test_inside_is_the_distance_to_the_nearest_edge(turn: float, order: int) -> None:
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    corners = np.array([[0.2, 0.3, 0], [-0.2, 0.3, 0], [-0.2, -0.3, 0], [0.2, -0.3, 0]])[::order] @ rotation.T
    one = Plate("plate1", 2, corners, Wrench(np.zeros(1), np.zeros((1, 6))))
    points = np.array([[0, 0, 0.0], [0.15, 0, 9], [0.25, 0, 0], [0, 0.29, 0]]) @ rotation.T
    assert inside(one, points) == pytest.approx([0.2, 0.05, -0.05, 0.01])


def test_distance_to_a_hull() -> None:
    square = np.array([[0, 0], [1, 1], [1, 0], [0, 1], [0.5, 0.5]], dtype=float)
    points = np.array([[0.2, 0.7], [1.5, 0.5], [-3, -4], [0.5, -0.1], [0.99, 0.98]])
    assert distance_to_hull(points, np.tile(square, (5, 1, 1))) == pytest.approx([0, 0.5, 5, 0.1, 0])


def test_soles_point_from_heel_to_toe() -> None:
    xyz = np.array([[[0, 0, 0.03], [0.2, 0, 0.04], [0, 1, 0.03], [0, 1.2, 0.04]]])
    soles = soles_from_markers(
        Markers(("RHEE", "RTOE", "LHEE", "LTOE"), np.zeros(1), xyz), read_marker_set("plug_in_gait")
    )
    right, left = soles.outline[0]
    assert right[:, 0].max() == pytest.approx(0.25)
    assert np.abs(right[:, 1]).max() == pytest.approx(0.046)
    assert right[:, 2].max() == pytest.approx(0.04)
    assert left[:, 1].max() == pytest.approx(1.25)
    assert right[1, 1] < 0 < right[0, 1]
