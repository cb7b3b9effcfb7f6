"""Is another hypothesis nearly as good? Alignments that explain nearly as much are refined and compared by the wrench,
which sees far more than they do.
"""

from collections.abc import Callable

import numpy as np

from biodance.errors import TrialRefused
from biodance.registration.alignment import Alignment
from biodance.registration.pose import FramePose
from biodance.registration.refinement import ENOUGH_ROWS, Refined

_NEARLY = 0.85
"""Share of the best alignment's gain from which on another one is looked at."""
_MOST = 3
_SAME = 0.03
"""s between the delays of two refined poses that are one."""
_CLEARLY = 10.0
"""Natural logarithms by which the wrench must prefer one to the other."""


def rival_delays(
    hypotheses: tuple[Alignment, ...], found: Refined, refine: Callable[[FramePose], Refined]
) -> tuple[Alignment, ...]:
    """Return the hypotheses after the first, refined to ``found``, that are not clearly worse."""
    near = [one for one in hypotheses[1:] if one.gain > _NEARLY * hypotheses[0].gain][:_MOST]
    return tuple(one for one in near if _remains(one, found, refine))


def _remains(one: Alignment, found: Refined, refine: Callable[[FramePose], Refined]) -> bool:
    if found.rows < ENOUGH_ROWS:
        return True
    try:
        other = refine(one.pose)
    except TrialRefused:
        return False
    if abs(other.pose.delay - found.pose.delay) < _SAME:
        return False
    worse = 0.5 * min(found.rows, other.rows) * (other.fit - found.fit)
    return other.rows >= ENOUGH_ROWS and not (np.isfinite(worse) and worse > _CLEARLY)
