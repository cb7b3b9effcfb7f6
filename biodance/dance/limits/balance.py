"""The zero-moment point (at rest: the projected centre of mass) stays inside the reduced support (paper eq. 16)."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, ForImprecise, ImpreciseCopy, Limit, Margins, Remaining, bounded
from biodance.dance.problem.stance import Stance, support_depth
from biodance.dance.problem.state import State
from biodance.records import Array


@dataclass(frozen=True)
class Balance(Limit):
    """``share`` of every half width of the base of support, from its middle, that may be used (paper: 0.6); ``room`` m
    inside the edge of the whole support that imprecise people keep.
    """

    share: float = bounded(0.6, 0.1, 1.0)
    room: float = bounded(0.015, 0.0, 0.1, "m", imprecise=True)
    name, unit, scale, suspicion = "balance", "m", 0.03, 30
    mended_by_slowness = True

    @property
    def support_share(self) -> float:
        """The share itself."""
        return self.share

    def hold_reserve(self, stance: Stance) -> float:
        """More than others': whoever leaves the edge of the support first pushes the zero-moment point towards it.

        With the weight over one foot there is no more room.
        """
        return 0.2 if stance.over is None else super().hold_reserve(stance)

    def margins(self, state: State) -> Margins:
        """Return the distance of the zero-moment point inside every edge of the reduced support, (T, edges) m."""
        normals, offsets = state.stance.reduced(self.share)
        # n p + o, distance inside every edge; linear in p.
        return Margins(state.zmp @ normals.T + offsets, normals @ state.zmp_slopes)

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the distance (T, 1) m inside the reduced base of the true soles, of all feet that may bear all."""
        point, soles = motion.wrench.cop()[:, :2], [sole[0, :, :2] for sole in motion.soles]
        corners = [np.concatenate([*(soles[side] for side in base), motion.stance.props]) for base in motion.bases]
        least = np.min([_inside(point, some, self.share) for some in corners], axis=0)
        return Remaining(least[:, None], (motion.stance.name,))

    def for_imprecise(self) -> ForImprecise:
        """Nobody comes nearer than ``room`` to the edge of the whole support."""
        return ForImprecise(_left, self.room, "balance_m", "reserve for the balance")


LIMIT = Balance


def _left(copy: ImpreciseCopy) -> Remaining:
    """Return the distance (T, kinds of stance) m inside the whole support, infinite where another stance is taken."""
    names = tuple(dict.fromkeys(copy.stances[k].name for k in np.unique(copy.on)))
    taken = np.array([stance.name for stance in copy.stances])[copy.on]
    inside = support_depth(copy.stances, copy.on, copy.zero_moment_point)
    return Remaining(np.where(taken[:, None] == np.array(names), inside[:, None], np.inf), names)


def _inside(point: Array, corners: Array, share: float) -> Array:
    """Return the distance (T,) m of points (T, 2) inside the hull of ``corners`` (K, 2), reduced to ``share``."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    normals, offsets = hull.equations[:, :2], hull.equations[:, 2]
    # Outward normals, n p + o <= 0 inside.
    room = -(middle @ normals.T + offsets)  # from the middle to every edge
    # Every edge drawn to `share` of its distance from the middle.
    return np.asarray((share * room - (point - middle) @ normals.T).min(axis=1))
