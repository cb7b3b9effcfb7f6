"""Bodies that move alike: lengths times L, masses times M, time times sqrt(L), so that the same angles are the same
movement (Froude 1861).

Under gravity two bodies of the same shape and mass distribution move alike where times go with the square root of
lengths: angles, friction and balance are then the same, forces go with M, moments with M L, speeds of joints with 1 /
sqrt(L). So a dance may be designed for a body of convenient size and danced, exactly, by its small or large likeness.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import JointLimits
from biodance.records import Array, Sip


@dataclass(frozen=True)
class Likeness:
    """``length`` and ``mass``: factors from a body to its likeness."""

    length: float
    mass: float

    @property
    def time(self) -> float:
        """Factor of times."""
        return float(np.sqrt(self.length))


def likeness(body: Body, to: Likeness) -> Body:
    """Return the body of the same shape and angles, with all lengths, masses, strengths and speeds changed by the
    factors of ``to``.
    """
    length, mass, limits = to.length, to.mass, body.limits
    units: Array = mass * np.tile([1.0, *[length] * 3, *[length**2] * 6], len(body.segments))
    return replace(
        body,
        joints=tuple(replace(joint, translation=length * joint.translation) for joint in body.joints),
        sip=Sip(body.segments, units * body.sip.phi, np.outer(units, units) * body.sip.covariance),
        limits=JointLimits(
            limits.lower,
            limits.upper,
            limits.velocity / to.time,
            mass * length * limits.torque_lower,
            mass * length * limits.torque_upper,
        ),
        markers=replace(body.markers, position=length * body.markers.position),
        boxes=length * body.boxes,
        com_boxes=length * body.com_boxes,
        feet={side: replace(foot, outline=length * foot.outline) for side, foot in body.feet.items()},
    )
