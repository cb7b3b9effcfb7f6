"""The pose from the feet: where the pressure lies in the foot of an ordinary step, and when the heel strikes.

What steps share (a person's foot, a laboratory's way to put its toe marker) is shared in their covariance: two steps of
one foot do not halve it. Norms and standard deviations are those of the witnesses.
"""

from dataclasses import dataclass

import numpy as np

from biodance.records import Array
from biodance.registration.pull import PoseEvidence
from biodance.registration.steps import PlateStep
from biodance.witnesses.foot_across import ACROSS_PHASES
from biodance.witnesses.foot_along import ALONG_PHASES
from biodance.witnesses.force_onset import ONSET_AFTER_STRIKE

_ACROSS, _ALONG = tuple(ACROSS_PHASES.values()), tuple(ALONG_PHASES.values())


@dataclass(frozen=True, eq=False)
class _Row:
    """``value`` observed minus expected, its ``slope`` (4,) on the pose's change, and its errors: ``own`` sd and
    ``shared`` sd by what it is shared with.
    """

    value: float
    slope: Array
    own: float
    shared: dict[str, float]


def feet_pull(steps: tuple[PlateStep, ...], about: Array) -> PoseEvidence | None:
    """Return what the feet say of a change of the pose about ``about`` (3,) m; None without a step."""
    rows = [row for step in steps for row in _rows(step, about) if np.isfinite(row.value)]
    if not rows:
        return None
    value, slope = np.array([row.value for row in rows]), np.array([row.slope for row in rows])
    covariance = np.diag([row.own**2 for row in rows])
    for i, one in enumerate(rows):
        for j, other in enumerate(rows):
            covariance[i, j] += sum(sd * other.shared.get(key, 0.0) for key, sd in one.shared.items())
    weight = np.linalg.inv(covariance)
    information, vector = slope.T @ weight @ slope, -slope.T @ weight @ value
    left = value + slope @ (np.linalg.pinv(information) @ vector)
    free = max(1, len(rows) - np.linalg.matrix_rank(slope))
    return PoseEvidence(information, vector, float(left @ weight @ left) / free, len(rows))


def _rows(step: PlateStep, about: Array) -> list[_Row]:
    """Return the observations of one step."""
    rows, heel_first = [], step.heel_first
    for number, (start, stop, expected, own, foot, laboratory) in enumerate(_ACROSS):
        if number or heel_first:
            shared = {f"{step.side} across {number}": foot, f"across {number}": laboratory}
            rows.append(_mean(step, step.beside, step.outwards, (start, stop), expected, own, shared, about))
    for number, (start, stop, share, *sds) in enumerate(_ALONG if heel_first else ()):
        own, person, laboratory = (sd * step.length for sd in sds)
        shared = {f"along {number}": float(np.hypot(person, laboratory))}
        expected = share * step.length
        rows.append(_mean(step, step.ahead, step.forwards, (start, stop), expected, own, shared, about))
    if heel_first:
        expected, own, laboratory = ONSET_AFTER_STRIKE
        rows.append(_Row(step.onset - expected, np.array([0.0, 0.0, 0.0, -1.0]), own, {"onset": laboratory}))
    return rows


def _mean(
    step: PlateStep,
    values: Array,
    axis: Array,
    phase: tuple[float, float],
    expected: float,
    own: float,
    shared: dict[str, float],
    about: Array,
) -> _Row:
    """Return the mean of ``values`` (n,) along ``axis`` (n, 3) over a phase of the stance, as a row."""
    here = (step.phase >= phase[0]) & (step.phase <= phase[1])
    if not here.any():
        return _Row(np.nan, np.zeros(4), own, shared)
    arm = step.place[here] - about
    turned = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    along = axis[here, :2]
    slope = np.array([*along.mean(axis=0), np.einsum("ti,ti->t", along, turned).mean(), 0.0])
    return _Row(float(values[here].mean()) - expected, slope, own, shared)
