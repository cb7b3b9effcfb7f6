"""A walk on a ramp is read, tracked and judged as on the level.

Truth by construction: with z' = z + s x for every point of mass, forces become Fz' = Fz + s Fx, and Mx, about an
origin on the floor, becomes Mx - s Mz (likewise with y). That is exact, whatever the masses; a real walk on the level
becomes one up or down a ramp, whose person is bent by the ramp's angle.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import biodance
from biodance.pipeline.results import SessionResult
from biodance.records import Trial


def tilted(trial: Trial, slope: float) -> Trial:
    """Return the trial on a ramp that rises by ``slope`` along the axis on which the person walks."""
    xyz = np.array(trial.markers.xyz)
    way = np.nanmedian(xyz, axis=1)[:, :2]
    along = int(np.argmax(np.ptp(way[np.isfinite(way).all(axis=1)], axis=0)))
    xyz[..., 2] += slope * xyz[..., along]
    plates = []
    for plate in trial.plates:
        value, corners = np.array(plate.wrench.value), np.array(plate.corners)
        value[:, 2] += slope * value[:, along]
        value[:, 3 + along] -= slope * value[:, 5]
        corners[:, 2] += slope * corners[:, along]
        plates.append(replace(plate, corners=corners, wrench=replace(plate.wrench, value=value)))
    return replace(trial, markers=replace(trial.markers, xyz=xyz), plates=tuple(plates))


@pytest.mark.parametrize("degrees", [5.0, -5.0])
def test_a_walk_on_a_ramp_is_judged_as_on_the_level(recording: Callable[[str], SessionResult], degrees: float) -> None:
    flat = recording("biomechzoo/HC032A")
    level = flat.session
    trials = tuple(
        one if one.role == "static" else tilted(one, float(np.tan(np.radians(degrees)))) for one in level.trials
    )
    results = [flat, biodance.examine(replace(level, trials=trials))]
    for flat, ramp in zip(*(one.trials for one in results), strict=True):
        assert ramp.motion is not None
        assert flat.motion is not None
        assert ramp.comparison is not None
        assert flat.comparison is not None
        rms = [float(np.sqrt(np.nanmean(one.motion.residual**2))) for one in (flat, ramp)]
        assert rms[1] < rms[0] + 0.004, ramp.name
        weight = 9.81 * level.subject.mass
        np.testing.assert_allclose(ramp.comparison.rms[:3], flat.comparison.rms[:3], atol=0.015 * weight)
    assert biodance.diagnose(results[1]).diagnosis.verdict == "nothing wrong"
