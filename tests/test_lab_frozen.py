"""Markers that repeat the frame before to the last digit are not seen, and that is said."""

from pathlib import Path

import numpy as np
import pytest

from biodance.lab.markers.signals import frozen_frames, without_frozen
from biodance.records import Markers, Source, Trial


@pytest.fixture
def xyz():
    rng = np.random.default_rng(5)
    return rng.normal(size=(1, 6, 3)) + 1e-4 * rng.normal(size=(60, 6, 3))


def trial(xyz) -> Trial:
    time = np.arange(len(xyz)) / 100.0
    markers = Markers(tuple("abcdef"), time, xyz)
    return Trial("walk", "fit", markers, (), Source(Path("walk.c3d"), "", "test"))


def test_held_frames_are_not_seen_and_said(xyz) -> None:
    xyz[20:31] = xyz[20]
    thawed = without_frozen(trial(xyz))
    assert np.flatnonzero(np.isnan(thawed.markers.xyz).all(axis=(1, 2))).tolist() == list(range(21, 31))
    np.testing.assert_array_equal(thawed.markers.xyz[:21], xyz[:21])
    assert "0.21 to 0.30 s" in thawed.warnings[0]
    assert "10 frames" in thawed.warnings[0]


def test_a_marker_that_is_never_seen_hides_no_held_frames(xyz) -> None:
    xyz[20:31] = xyz[20]
    xyz[:, 2] = np.nan
    assert frozen_frames(xyz).sum() == 10


@pytest.mark.parametrize("held", [slice(20, 25), slice(0, 0), slice(0, 60)])
def test_repeated_frames_of_a_slow_camera_noise_and_a_kept_posture_stay(xyz, held) -> None:
    if held.stop:
        xyz[held] = xyz[held.start]
    one = trial(xyz)
    assert without_frozen(one) is one


def test_one_marker_on_the_floor_that_never_moves_is_no_frozen_frame(xyz) -> None:
    xyz[:, 0] = xyz[0, 0]
    assert not frozen_frames(xyz).any()


def test_a_computed_movement_that_comes_to_rest_by_and_by_is_no_frozen_frame() -> None:
    phase = np.clip(np.linspace(-1.0, 2.0, 300), 0.0, 1.0)  # a second of rest, one of movement, one of rest
    moved = np.linspace(0.1, 0.6, 6)[:, None] * [1.0, 0.5, 0.2]
    way = phase**3 * (10 - 15 * phase + 6 * phase**2)
    assert not frozen_frames((way[:, None, None] * moved).astype(np.float32).astype(float)).any()


@pytest.mark.parametrize("first", [1, 2, 3, 20])
def test_a_recording_that_hangs_from_its_first_frames_to_its_end_is_frozen(first: int) -> None:
    """Two centimetres a frame, as somebody walks, and then not a digit more."""
    place = np.minimum(np.arange(60), first + 1) * 0.02
    xyz = np.zeros((60, 6, 3)) + np.arange(6.0)[:, None]
    xyz[..., 0] += place[:, None]
    assert frozen_frames(xyz).sum() == 60 - first - 2
