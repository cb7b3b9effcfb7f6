"""A knee that bends elsewhere than it was marked is told, one that was marked as people are is not."""

import re
from pathlib import Path

import numpy as np
import pytest
from joint_cases import displaced, hidden, moving, scaling
from scipy.stats import norm
from standing_markers import stand

from biodance.body.human.measures import standing
from biodance.motion.ik.functional_joints import functional_joints
from biodance.motion.ik.joint_unknowns import SIZE, JointUnknowns, mismarked, own_centre, own_turn
from biodance.records import Array, Markers, Source, Trial


def knees(theta: Array) -> list[str]:
    """Return what is said of knees beside which the markers were put, ``theta`` (37,) where the joints are."""
    found = functional_joints(scaling(), [moving(displaced(theta))])
    return [note for note in found.notes if "lateral marker" in note]


def elsewhere(ahead: float, turned: float) -> Array:
    """Return a left knee whose axis passes ``ahead`` m before its lateral marker (lab x, the person faces x), turned
    about the bone by ``turned`` rad in the lateral marker.
    """
    theta, centres = np.zeros(SIZE), scaling().centres
    theta[own_turn("left_knee")] = turned
    arm = centres.place["left_knee"] - centres.lateral["left_knee"]
    bone = JointUnknowns(centres).bone("left_knee")
    theta[own_centre("left_knee")] = turned * np.cross(bone, arm) + [ahead, 0.0, 0.0]
    return theta


def test_knees_where_they_were_marked_are_not_mentioned() -> None:
    assert knees(hidden()) == []
    assert knees(elsewhere(0.008, 0.1)) == []


@pytest.mark.parametrize("far", [0.0, 2.0, 3.2, 3.5, 5.0])
def test_a_knee_was_marked_elsewhere_where_that_is_more_probable_than_chance(far: float) -> None:
    """Of a thousand knees 20 are marked elsewhere, by three times as much as the others are by chance."""
    wrong, right = 20 * norm.pdf(far, scale=3.0), 980 * norm.pdf(far)
    assert mismarked(far) == pytest.approx(wrong / (wrong + right))
    assert (mismarked(far) > 0.5) == (far > 3.3)


@pytest.mark.parametrize(("ahead", "turned"), [(-0.04, 0.0), (0.04, 0.0), (0.0, 0.9)])
def test_a_knee_that_bends_elsewhere_is_a_warning(ahead: float, turned: float) -> None:
    (said,) = knees(elsewhere(ahead, turned))
    assert said.startswith("Warning: the left knee bends about an axis ")
    millimetres, way, degrees = re.search(r"axis (\d+) mm (\w+) its lateral marker and (\d+) degrees", said).groups()
    for found, true in ((int(millimetres), 1e3 * abs(ahead)), (int(degrees), np.degrees(abs(turned)))):
        assert 0.7 * true - 9 < found < true + 9  # the placing leaves a part where the markers are
    assert not ahead or way == ("before" if ahead > 0 else "behind")


def test_a_knee_alignment_device_stands_in_for_the_knee_marker() -> None:
    pig = {f"{side}_{place}": f"{side[0].upper()}{name}" for side in ("right", "left") for place, name in LEGS.items()}
    markers = stand(pig)
    knee = markers["RKNE"][0]
    arms = np.linalg.qr(np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 1.0], [2.0, 1.0, 1.0]]))[0]
    out = np.sign(arms @ [0.0, -1.0, 0.0])[:, None] * arms  # away from the body, which is on the left of the knee
    xyz = np.concatenate([markers.xyz, np.tile(knee + 0.08 * out, (3, 1, 1))], axis=1)
    device = Markers((*markers.names, "RKAX", "RKD1", "RKD2"), markers.time, xyz)
    posture = standing(
        Trial(
            "static",
            "static",
            device.select([name for name in device.names if name != "RKNE"]),
            (),
            Source(Path("static.c3d"), "", "C3D", 100.0),
            marker_set="plug_in_gait",
        )
    )
    assert posture.landmarks["right_knee_lateral"] == pytest.approx(knee, abs=1e-9)
    assert posture.landmarks["right_knee_axis"] == pytest.approx(device["RKAX"][0])


LEGS = {"asis": "ASI", "psis": "PSI", "knee_lateral": "KNE", "ankle_lateral": "ANK", "heel": "HEE", "toe": "TOE"}
