"""A body that moves otherwise than where tolerances were learned: at more joints, or at joints that no marker shows.

What is left of the forces may be its own. So nothing is told beside it while anything is left.
"""

from dataclasses import replace

from biodance.body.body import Body
from biodance.diagnosis.reasons import Reason
from biodance.inference.decision import Inferred

_LEFT = ("unexplained", "named, incomplete")
"""Verdicts beside which something is left."""


def beside_another_body(found: Inferred, body: Body, joints: tuple[str, ...]) -> Inferred:
    """Return a diagnosis of ``body`` that says why it cannot tell what is left, where that may be the body's own, with
    its names as no more than what is resembled; ``joints`` are those that it moves at beside the usual ones.
    """
    doubt, one = _doubt(body, joints), found.diagnosis
    if not doubt or one.verdict not in _LEFT or one.doubted or found.search.rows.problem is None:
        return found
    told = replace(
        one, verdict="unexplained", findings=(), resembles=(*one.findings, *one.resembles), why={**one.why, **doubt}
    )
    return replace(found, diagnosis=told, named=())


def _doubt(body: Body, joints: tuple[str, ...]) -> dict[Reason, tuple[str, ...]]:
    """Return why what is left may be the body's own, with the joints; empty where it moves as usual."""
    hidden = dict.fromkeys(j.name.rsplit("_", 1)[0] for j, free in zip(body.joints, body.free, strict=True) if not free)
    if hidden:
        return {Reason.UNSEEN_JOINTS: tuple(name.replace("_", " ") for name in hidden)}
    return {Reason.UNDESCRIBED_JOINTS: joints} if joints else {}
