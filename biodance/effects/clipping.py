"""An amplifier or converter is at its end: the channel stays flat where the load goes on."""

import numpy as np

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, unit_of
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.records import CHANNELS, Array, Trial
from biodance.spatial import wrench_about_point

_LONGEST = 0.015
"""s that a channel may stay at its extreme value."""
_CLEARLY = 3.0
"""How many times longer than anywhere else the flat top must be: coarse converters repeat values everywhere."""
_SAME = 2e-5
"""Share of the channel's range within which two samples are the same number."""
_LEVELS = 64
"""Different values that a channel must have taken: a movement of a few steps of the converter has flat tops anyway."""
AT_ZERO = 0.05
"""Share of the largest value under which a flat part is an unloaded plate."""


class Clipping(DiscreteEffect):
    """A channel of a plate that is flat at its top or bottom."""

    name = "clipping"
    separated_by = "The histogram of the raw samples."
    advice = (
        "Choose a larger range of the amplifier for this channel and repeat the movement; what was cut off is lost."
    )
    about = About(
        what="An amplifier or converter is at its end: the channel stays flat where the load goes on.",
        signature="The highest (or lowest) value of a channel comes many times in a row, exactly.",
        look_alikes="An unloaded plate whose noise was set to zero (flat at zero, not at the top).",
        settled_by="The histogram of the raw samples.",
    )
    words = CauseWords(
        "{it} is cut off at its largest values", "Choose a larger range, and record again.", "a cut-off channel"
    )
    explains = (CheckKind.WEIGHT, CheckKind.FORCES)
    raw = True

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check per channel that clips, or one that says none does."""
        found: dict[str, tuple[float, str]] = {}
        trials = [trial for trial in recorded.session.trials if trial.plates]
        for trial in trials:
            for target, limit in clipped(trial):
                found.setdefault(target, (limit, trial.name))
        if found:
            said = "{} is flat at {:.4g} (first in {}): the amplifier or converter is at its end."
            return tuple(
                QualityCheck(
                    "range of the channels",
                    False,
                    said.format(target, limit, trial),
                    cls.name,
                    target,
                    abs(limit),
                    "limit",
                    unit_of(target),
                )
                for target, (limit, trial) in found.items()
            )
        return (
            (QualityCheck("range of the channels", True, "No channel of the plates is flat at its extremes."),)
            if trials
            else ()
        )


def clipped(trial: Trial) -> list[tuple[str, float]]:
    """Return target and level of every channel that clips, about the plate's centre in lab axes and with its zero
    still in it.
    """
    found = []
    for plate in trial.plates:
        channels = wrench_about_point(plate.wrench.value, plate.centre)
        for k, name in enumerate(CHANNELS):
            level = flat_level(channels[:, k], plate.wrench.rate)
            if level is not None:
                target = name if len(trial.plates) == 1 else f"{plate.name}:{name}"
                found.append((target, level + (plate.zero[k] if k < 3 else 0.0)))
    return found


def flat_level(values: Array, rate: float) -> float | None:
    """Return the level (unit of ``values`` (S,)) at which a channel is flat; None where it is not. What is flat from
    the first sample or to the last one was not reached and left: there a file was filled up.
    """
    values = values[np.isfinite(values)]
    span = float(np.ptp(values)) if values.size > 2 else 0.0
    if not span > 0 or np.unique(np.round(values / (_SAME * span))).size < _LEVELS:
        return None
    same = np.abs(np.diff(values)) <= _SAME * span
    # Starts of all runs of equal neighbours; their ends below.
    starts = np.flatnonzero(same & ~np.append(False, same[:-1]))
    stops = np.flatnonzero(same & ~np.append(same[1:], False)) + 1
    lengths, levels = stops - starts, values[starts]
    highest, lowest, inside = values.max(), values.min(), (starts > 0) & (stops < values.size - 1)
    between = (levels < highest - 2 * _SAME * span) & (levels > lowest + 2 * _SAME * span)
    between &= np.abs(levels) > AT_ZERO * np.abs(values).max()  # an empty plate that is set to zero is flat, too
    elsewhere = lengths[between].max(initial=1)
    for extreme in (highest, lowest):
        at = inside & (np.abs(levels - extreme) <= 2 * _SAME * span)
        long = lengths[at].max(initial=0)
        if long > _LONGEST * rate and long > _CLEARLY * elsewhere and abs(extreme) > AT_ZERO * np.abs(values).max():
            return float(extreme)
    return None


EFFECT = Clipping
