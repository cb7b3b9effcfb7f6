"""A body that moves otherwise than where tolerances were learned: at more joints, or at joints that no marker shows.

What is left of the forces may be its own. So nothing is told beside it while anything is left.
"""

from dataclasses import replace

from biodance.body.body import Body
from biodance.diagnosis.engine import Examined, without_name, without_names
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.repairs import unplaced_markers
from biodance.effects.marker_misplaced import MarkerMisplaced

_LEFT = ("unexplained", "named, incomplete")
"""Verdicts beside which something is left."""


def beside_another_body(examined: Examined, body: Body, joints: tuple[str, ...]) -> Examined:
    """Return a diagnosis of ``body`` that says why it cannot tell what is left, where that may be the body's own, with
    its names as no more than what is resembled; ``joints`` are those that it moves at beside the usual ones.
    """
    doubt = _doubt(body, joints)
    if not doubt or examined.diagnosis.verdict not in _LEFT or examined.diagnosis.doubted:
        return examined
    found = without_names(examined, examined.diagnosis.checks) if examined.diagnosis.findings else examined
    return replace(found, diagnosis=replace(found.diagnosis, why={**found.diagnosis.why, **doubt}))


def without_unplaced_markers(examined: Examined, body: Body) -> Examined:
    """Return a diagnosis of ``body`` that says of no marker that it moved since a static trial which contradicts itself
    beside it (`unplaced_markers`): it is only resembled, and what is left is judged without it.
    """
    unsure = unplaced_markers(body)
    while True:
        names = [(one.effect, one.target) for one in examined.diagnosis.findings]
        found = next((i for i, (kind, at) in enumerate(names) if kind == MarkerMisplaced.name and at in unsure), None)
        if found is None:
            return examined
        examined = without_name(examined, found)


def _doubt(body: Body, joints: tuple[str, ...]) -> dict[Reason, tuple[str, ...]]:
    """Return why what is left may be the body's own, with the joints; empty where it moves as usual."""
    hidden = dict.fromkeys(j.name.rsplit("_", 1)[0] for j, free in zip(body.joints, body.free, strict=True) if not free)
    if hidden:
        return {Reason.UNSEEN_JOINTS: tuple(name.replace("_", " ") for name in hidden)}
    return {Reason.UNDESCRIBED_JOINTS: joints} if joints else {}
