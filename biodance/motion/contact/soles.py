"""Where the soles of the feet are: from the heel and toe markers, or from the tracked body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.lab.markers.sets import MarkerSet, landmark
from biodance.motion.kinematics import in_blocks, poses
from biodance.records import SIDES, Array, Markers, Motion, freeze

OUTLINE = np.array([[0.0, 0.17], [0.0, -0.17], [0.6, -0.21], [1.0, -0.23], [1.25, 0.0], [1.0, 0.23], [0.6, 0.21]])
"""(P, 2) outline of a sole, in units of the horizontal distance from the heel to the toe marker: forwards from the heel
marker, and to the left. From foot length 0.152, breadth 0.055 and heel breadth 0.040 of stature (Winter 2009; ANSUR II
2012) and a distance of the markers of 0.121 of stature.
"""


@dataclass(frozen=True, eq=False)
class Soles:
    """Outlines of both soles: ``time`` (T,) s; ``outline`` (T, 2, P, 3) m, lab frame, right foot first, P points around
    the sole.

    The heights are those of the markers or of the body's sole; the contact finds out how far they are above the ground
    in standing. NaN = not seen.
    """

    time: Array
    outline: Array

    def __post_init__(self) -> None:
        freeze(self, "Soles", time=(None,), outline=(np.size(self.time), 2, None, 3))

    @cached_property
    def centre(self) -> Array:
        """(T, 2, 3) m, mean of the outline's points; right foot first; read-only."""
        centre = self.outline.mean(axis=2)
        centre.setflags(write=False)
        return centre


def soles_from_markers(markers: Markers, marker_set: MarkerSet) -> Soles:
    """Return the soles from the landmarks heel and toe (second metatarsal head) of each foot.

    Points between the two markers have the height that is interpolated between them; the toes bend, so that the tip has
    the height of the toe marker.

    Raises
    ------
    TrialRefused
        The recording lacks a heel or a toe marker.
    """
    feet = []
    for side in SIDES:
        heel, toe = (landmark(markers, marker_set, f"{side}_{name}") for name in ("heel", "toe"))
        if heel is None or toe is None:
            raise TrialRefused(
                f"The {side} foot has no heel or no toe marker, so its contact with the ground is unknown. Put both on."
            )
        ahead = (toe - heel) * np.array([1.0, 1.0, 0.0])
        to_left = np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(ahead))], axis=1)
        rise = (toe - heel) - ahead
        feet.append(np.stack([heel + x * ahead + y * to_left + min(x, 1.0) * rise for x, y in OUTLINE], axis=1))
    return Soles(markers.time, np.stack(feet, axis=1))


def soles_from_body(body: Body, motion: Motion) -> Soles:
    """Return the soles of the tracked body, from its ``feet``.

    Raises
    ------
    TrialRefused
        The body has no right or no left foot, or the two outlines have different numbers of points.
    """
    absent = [side for side in SIDES if side not in body.feet]
    if absent or len({body.feet[side].outline.shape for side in SIDES}) > 1:
        raise TrialRefused(
            f"The body {body.name} lacks two feet with outlines of equally many points, so its ground contact is "
            f"unknown."
        )
    feet = [body.feet[side] for side in SIDES]
    segments, points = [foot.segment for foot in feet for _ in foot.outline], np.concatenate([f.outline for f in feet])
    outline = np.empty((motion.time.size, 2, len(points) // 2, 3))
    for part, frames in in_blocks(motion):
        outline[part] = poses(body, frames.q).points(segments, points).reshape(-1, *outline.shape[1:])
    outline.setflags(write=False)  # the record keeps it without a copy
    return Soles(motion.time, outline)
