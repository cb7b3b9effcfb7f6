"""Nothing but the feet comes to the floor: hands, knees, trunk and head, a robot's as a person's (feet have limits of
their own).

Segments are capsules, as where they must not touch each other (`problem.shapes`); the ends at the ankles are left out.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.limits import CheckedMotion, ForImprecise, ImpreciseCopy, Limit, Margins, Remaining, bounded
from biodance.dance.problem.shapes import Solids
from biodance.dance.problem.state import State
from biodance.motion.kinematics import Poses, poses
from biodance.records import Array


@dataclass(frozen=True)
class Floor(Limit):
    """``gap`` m that is left under the surface of every part but the feet at least; of a part that is nearer to the
    floor where the body stands upright, half of what is left there. By default 4 cm: the round end of a capsule of
    5 cm, a hand's, lacks 3.6 cm of the corner of its box.
    """

    gap: float = bounded(0.04, 0.0, 0.2, "m")
    name, unit, scale, suspicion = "floor", "m", 0.05, 55

    def margins(self, state: State) -> Margins:
        """Return what is left under both ends of every capsule, (T, ends) m, less the gap."""
        parts = LowParts.of(state.chain.body)
        place = state.placed(parts.segment, parts.place)
        slopes = state.along(parts.segment, place, np.broadcast_to([0.0, 0.0, 1.0], place.shape))
        # Half of what is left upright, where that is less than the gap.
        return Margins(place[:, :, 2] - parts.radius - np.minimum(self.gap, parts.upright / 2), slopes[None])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return what is left under every part, (T, parts) m, less the gap, by middle, axis and width of its capsule,
        or by the one end that is no ankle.
        """
        body = motion.body
        parts = LowParts.of(body)
        lowest, names = _lowest(body, motion.pose), []
        for k, segment in enumerate(np.unique(parts.segment)):
            names.append(body.segments[segment])
            lowest[:, k] -= min(self.gap, float(parts.upright[parts.segment == segment].min()) / 2)
        return Remaining(lowest, tuple(names))

    def for_imprecise(self) -> ForImprecise:
        """Nobody has to touch the floor."""
        return ForImprecise(_left, 0.0, "floor_m", "room under hands, knees and head")


LIMIT = Floor


@dataclass(frozen=True, eq=False)
class LowParts:
    """Ends of capsules that must stay off the floor: their ``segment`` (E,), the ``place`` (E, 3) m of their middle
    there, their ``radius`` (E,) m, and ``upright`` (E,) m what is under their segment at zero angles.

    Ends at an ankle, segments without a box, and segments that reach the floor at zero angles are left out.
    """

    segment: NDArray[np.intp]
    place: Array
    radius: Array
    upright: Array

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, body: Body) -> "LowParts":
        """Return the parts of a body, worked out once."""
        segment, end = np.array(list(_ends(body)), dtype=np.intp).reshape(-1, 2).T
        solids, pose = Solids.of(body), poses(body, body.neutral[None])
        place, radius = solids.axis[segment, end], solids.radius[segment]
        soles = [pose.points([foot.segment] * len(foot.outline), foot.outline) for foot in body.feet.values()]
        ground = float(np.min([sole[:, :, 2].min() for sole in soles]))
        # Height under the round end over the soles, at zero angles.
        under = pose.points(list(segment), place)[0, :, 2] - radius - ground
        upright = np.array([under[segment == one].min() for one in segment])
        kept = upright > 0
        return cls(segment[kept], place[kept], radius[kept], upright[kept])


def _ends(body: Body) -> Iterator[tuple[int, int]]:
    """Yield segment and end (0, 1) of all capsules but the feet's, and but those ends to which a foot is joined."""
    axis, feet = Solids.of(body).axis, {foot.segment for foot in body.feet.values()}
    ankles = dict(body.place_on_segment(body.segment_joint[foot]) for foot in feet)
    for segment, box in enumerate(body.boxes):
        if segment in feet or not np.all(box[1] > box[0]):
            continue
        near = int(np.argmin(np.linalg.norm(axis[segment] - ankles[segment], axis=1))) if segment in ankles else None
        yield from ((segment, end) for end in (0, 1) if end != near)


def _lowest(body: Body, pose: Poses) -> Array:
    """Return the height (T, parts) m of the lowest point of every segment that has `LowParts`, in their order."""
    parts, out = LowParts.of(body), list[Array]()
    for segment in np.unique(parts.segment):
        own = parts.segment == segment
        middle, half = parts.place[own].mean(axis=0), (parts.place[own][-1] - parts.place[own][0]) / 2
        # Height of either end about the middle: + and - the same number; the lower one is - its size.
        over = np.abs(pose.rotation[:, segment, 2] @ half)
        height = pose.position[:, segment, 2] + pose.rotation[:, segment, 2] @ middle
        out.append(height - over - parts.radius[own][0])
    return np.stack(out, axis=1)


def _left(copy: ImpreciseCopy) -> Remaining:
    """Return the height (T, parts) m of the lowest point of every part."""
    segments = np.unique(LowParts.of(copy.body).segment)
    return Remaining(_lowest(copy.body, copy.pose), tuple(copy.body.segments[segment] for segment in segments))
