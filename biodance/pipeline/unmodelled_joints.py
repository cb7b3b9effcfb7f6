"""A body that moves otherwise than where tolerances were learned: at more joints, or at joints that no marker shows.

What is left of the forces may be its own, so no cause is taken from the simulation.
"""

from biodance.body.body import Body
from biodance.diagnosis.reasons import Reason


def unmodelled_joints(body: Body, joints: tuple[str, ...]) -> dict[Reason, tuple[str, ...]]:
    """Return why what a simulation of ``body`` leaves may be the body's own: joints that no marker shows, or
    ``joints`` that it moves at beside the usual ones, for which nobody has learned what is usual; empty where it moves
    as usual.
    """
    hidden = dict.fromkeys(j.name.rsplit("_", 1)[0] for j, free in zip(body.joints, body.free, strict=True) if not free)
    if hidden:
        return {Reason.UNSEEN_JOINTS: tuple(name.replace("_", " ") for name in hidden)}
    return {Reason.UNDESCRIBED_JOINTS: joints} if joints else {}
