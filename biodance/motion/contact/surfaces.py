"""Heights on which the feet of a trial stand: plates, floor, steps."""

from dataclasses import dataclass

import numpy as np

from biodance.motion.contact.over import inside
from biodance.motion.contact.soles import Soles
from biodance.records import SIDES, Array, Mask, Trial, runs

SAME_LEVEL = 0.05
"""m: heights closer than this are one surface."""
MARKER_HEIGHT = 0.20
"""m: a point of a sole that stands on a plate is at most this far above it (foot markers sit lower)."""
ASYMMETRY = 0.02
"""m: the two feet's points may be this differently high above the ground."""
CARRIED = 0.9
"""Share of the body weight on the plates above which a foot that rests elsewhere is held in the air."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """``offset`` (2, P) m: height of each point of each sole above the ground in standing; ``levels`` m: heights on
    which a foot can stand; ``bare`` m: those of them that are not plates, the floor first; ``notes`` what was found.
    """

    offset: Array
    levels: tuple[float, ...]
    bare: tuple[float, ...]
    notes: tuple[str, ...]


def find_surfaces(trial: Trial, soles: Soles, rests: Mask, load: Mask, *, weight: float) -> Surfaces:
    """Return the surfaces of a trial; ``rests`` (T, 2), ``load`` (T, plates) True where loaded, ``weight`` N (NaN =
    unknown).
    """
    plates = sorted({round(plate.height, 3) for plate in trial.plates})
    offset = _offsets(trial, soles, rests, load)
    low = (soles.outline[..., 2] - offset).min(axis=2)
    total = trial.wrench.force[:, 2]
    bare: list[float] = []
    notes: list[str] = []
    for foot, side in enumerate(SIDES):
        lifted = 0
        for start, stop in runs(rests[:, foot]):
            span = slice(start, stop)
            level, over = float(np.median(low[span, foot])), _over(trial, soles.centre[span, foot], load[span])
            known = [height for height in plates if abs(height - level) < SAME_LEVEL]
            if (over and known) or any(abs(height - level) < SAME_LEVEL for height in bare):
                continue
            if not known and np.mean(total[span]) >= CARRIED * weight:
                lifted += 1
                continue
            bare.append(known[0] if known else level)
            when = f"{soles.time[start]:.2f} to {soles.time[stop - 1]:.2f} s"
            notes.append(f"The {side} foot stands beside the plates on a surface at {level:z.2f} m, {when}.")
        if lifted:
            often = f"{lifted} time{'s' * (lifted != 1)}"
            notes.append(f"The {side} foot rests in the air ({often}): the plates carry the weight meanwhile.")
    lowest = float(np.nanmin(low, initial=plates[0]))
    if lowest < min([*bare, plates[0]]) - SAME_LEVEL:
        notes.append(
            f"A foot goes down to {lowest:z.2f} m: the floor is at least that far below the lowest plate "
            f"({plates[0]:z.2f} m)."
        )
        bare.append(lowest)
    bare = sorted({min([*bare, plates[0]]), *bare})
    return Surfaces(offset, tuple(sorted({*plates, *bare})), tuple(bare), tuple(notes))


def _over(trial: Trial, centre: Array, load: Mask) -> bool:
    """Return whether a resting sole's ``centre`` (n, 3) is over a plate that is loaded meanwhile."""
    middle = np.median(centre, axis=0)
    return any(
        bool(inside(plate, middle) > 0) and bool(load[:, index].any()) for index, plate in enumerate(trial.plates)
    )


def _offsets(trial: Trial, soles: Soles, rests: Mask, load: Mask) -> Array:
    """Return the standing height (2, P) m of each point: low percentile while the foot rests on a loaded plate.

    A foot that never does takes the other's; if neither does, its lowest resting (or lowest) height is taken for the
    lowest plate's.
    """
    found = np.full(soles.outline.shape[1:3], np.nan)
    for foot in range(2):
        heights = []
        for index, plate in enumerate(trial.plates):
            above = soles.outline[:, foot, :, 2] - plate.height
            here = rests[:, foot] & load[:, index] & (inside(plate, soles.centre[:, foot]) > 0)
            heights.append(above[here & (above.min(axis=1) > -SAME_LEVEL) & (above.max(axis=1) < MARKER_HEIGHT)])
        standing = np.concatenate(heights)
        if len(standing):
            found[foot] = np.percentile(standing, 10, axis=0)
    if np.isnan(found).all():
        z = soles.outline[..., 2]
        lowest = np.where(rests[..., None], z, np.inf).min(axis=(0, 1))
        lowest = np.where(np.isfinite(lowest), lowest, np.nanmin(z, axis=(0, 1), initial=np.inf))
        found[:] = lowest - min(plate.height for plate in trial.plates)
    found = np.where(np.isnan(found), found[::-1], found)
    return np.minimum(found, found[::-1] + ASYMMETRY)
