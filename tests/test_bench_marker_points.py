"""Points that public marker sets on real persons make up ride on their segments: they turn with the person."""

from types import SimpleNamespace

import numpy as np
import pytest
from public_marker_sets import _CORNERS, Person, carried
from scipy.spatial.transform import Rotation

TURN, SHIFT = Rotation.from_euler("zyx", [0.7, -0.4, 0.9]), np.array([1.0, -2.0, 0.5])


def person(places: dict[str, np.ndarray]) -> Person:
    one = Person.__new__(Person)
    one.markers = SimpleNamespace(time=np.arange(3))
    one.path = lambda code, _: places[code]
    return one


@pytest.mark.parametrize("segment", ["pelvis", "trunk_head", "right_thigh", "left_forearm_hand"])
def test_a_point_keeps_its_place_on_a_segment_that_turns(segment):
    kind = segment.partition("_")[2] if segment.startswith(("right", "left")) else segment
    start = f"{segment[0].upper()}." if kind != segment else ""
    rng = np.random.default_rng(4)
    corners = {f"{start}{place}": np.repeat(rng.normal(size=(1, 3)), 3, axis=0) for place in _CORNERS[kind]}
    point = np.repeat(rng.normal(size=(1, 3)), 3, axis=0)
    moved = {code: TURN.apply(path) + SHIFT for code, path in corners.items()}
    there = carried(person(corners), person(moved), segment, point)
    assert there == pytest.approx(TURN.apply(point) + SHIFT)
