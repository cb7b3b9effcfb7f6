"""What the plates of a trial carry against what the movement needs: how much, and where its middle lies.

A plate that reads too little in every channel takes weight away on its own side; a person lighter than declared stays
over the middle.
"""

from dataclasses import dataclass

import numpy as np

from biodance.effects._base.case import Case
from biodance.motion.newton import facing, trunk_of
from biodance.records import Array
from biodance.spatial import wrench_about_point

_LOADED = 0.02
"""Share of the need under which the place of a plate's pressure says nothing: its centre stands for it."""

_STAYS = 0.25
"""m that a foot goes over the floor where nobody steps: less than a step (the pelvis goes back by more in a deep
squat). Whoever walks treads on each plate once, and where the pressure lies over one step says nothing of what the
plate reads.
"""


@dataclass(frozen=True)
class Carried:
    """``ratio`` of the mean vertical force that all plates carry to the one that the movement needs; ``off`` m, how far
    to the left of where it should be its place lies; by plate, the ``gain`` of all its channels that would explain the
    ratio, and how far off the place would be without it.
    """

    ratio: float
    off: float
    plates: dict[str, tuple[float, float]]


def carried_by_plates(case: Case) -> Carried | None:
    """Return what the plates of a trial carry, over the frames in which the markers show that they alone carry; None
    without such frames, with fewer than two plates, or of somebody who goes over them.
    """
    plates = case.trial.plates
    trunk = trunk_of(case.trial, mass=float(case.phi[::10].sum())) if len(plates) > 1 else None
    if trunk is None or trunk.covered.size != len(case.predicted) or not trunk.covered.any():
        return None
    feet = [k for k, name in enumerate(case.body.segments) if name.endswith("_foot")]
    ankles = case.poses.points(feet, np.zeros((len(feet), 3)))[trunk.covered, :, :2]
    if np.linalg.norm(np.ptp(ankles, axis=0), axis=1).max(initial=0.0) > _STAYS:
        return None
    middle = np.mean([plate.centre for plate in plates], axis=0)
    means = [
        wrench_about_point(value[trunk.covered], middle).mean(axis=0)
        for value in (case.predicted, *(plate.wrench.value for plate in plates))
    ]
    need, own = means[0], means[1:]
    total = np.sum(own, axis=0)
    if not (np.isfinite(total).all() and need[2] > 0 and total[2] > 0):
        return None
    ahead = facing(case.body, case.motion)
    left, lacks = np.array([-ahead[1], ahead[0]]), need[2] - total[2]
    found = {}
    for plate, wrench in zip(plates, own, strict=True):
        right = wrench[2] + lacks
        place = _place(wrench) if wrench[2] > _LOADED * need[2] else (plate.centre - middle)[:2]
        if right > 0:
            # Where all plates' pressure would lie if this plate also carried what lacks, at its
            # own place: mean by force.
            corrected = (total[2] * _place(total) + lacks * place) / need[2]
            found[plate.name] = float(wrench[2] / right - 1), float((corrected - _place(need)) @ left)
    return Carried(float(total[2] / need[2]), float((_place(total) - _place(need)) @ left), found)


def _place(wrench: Array) -> Array:
    """Return where (2,) m a wrench (6,) presses, in the plane of its point."""
    # x = -My / Fz, y = Mx / Fz about the point of the wrench.
    return np.array([-wrench[4], wrench[3]]) / wrench[2]
