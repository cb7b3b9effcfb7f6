"""The trunk bends in two places; the model bends it in one."""

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import Cut, with_part
from biodance.body.human.skeleton import share_of_body, shoulders
from biodance.effects._base.case import Case
from biodance.effects._base.missing_joint import MissingJoint, angle_and_beyond, doubting
from biodance.effects._base.words import About, CauseWords, CheckKind

XIPHION = 0.61
"""Height of the xiphion between the trunk's joint and the shoulders (de Leva 1996, from the omphalion: 0.58 men,
0.65 women).
"""
_PLACE = 0.25
"""Height of the joint, likewise: L1/L2, two lumbar vertebrae of 37 mm above the omphalion, in the middle of the
supple part of the back.
"""
_AXES = {"thorax_flexion": -np.eye(3)[2], "thorax_bending": np.eye(3)[0]}

ELSEWHERE = ("HD", "SHO", "UPA", "ELB", "FRM", "WRA", "WRB", "FIN")
"""Markers that follow the neck, the shoulder blades and the arms as well as the thorax."""


class TrunkJoint(MissingJoint):
    """The thorax bends by ``angle`` (rad rms per axis) on the loins, in the course of time that the trunk markers show;
    turning about the long axis cannot be told from the model's own joint.
    """

    name = "trunk_joint"
    parameters = angle_and_beyond(
        0.06,
        "5-10 deg rms between lumbar and thoracic spine (laboratory experience)",
        # rad that matter: as much as everybody moves it anyway (`natural`).
        least=0.05,
    )
    separated_by = "Rounding and arching the back alone, standing still."
    advice = "Accept a body with a thorax, and put two more markers on the loins (L1, L3)."
    about = About(
        what="The trunk bends in two places; the model bends it in one.",
        signature=(
            "The thorax leans and bends on the loins: half the body's mass moves by centimetres against the model, in"
            " Mx and My; the trunk markers stand away from where the pelvis would have them."
        ),
        look_alikes=(
            "Skin that slides over the spine, a trunk joint in the wrong place (which follows the trunk's angle only)."
        ),
        settled_by="Rounding and arching the back alone, and by markers on the loins.",
    )
    words = CauseWords("the trunk bends {size}{between} where the model is stiff", "Accept it.", "a bending trunk")
    explains = (CheckKind.MARKERS,)
    size_error = 0.5
    """Markers of six people showed 67 to 182 % of the angle: without any on the loins it is split between two joints as
    one of them is assumed to lie (docs/decisions/2026-11-21-detection-limits.md).
    """
    natural = 0.040
    """Root mean square of thirty virtual sessions, whose thorax moves by 1.2 deg on two axes."""

    @classmethod
    def extended_body(cls, case: Case) -> Body | None:
        """Return the body with two joints at L1/L2; None where the markers do not show the thorax."""
        body, middle = case.body, shoulders(case.body)
        if middle is None:
            return None
        index = body.segment_index("trunk_head")
        on = tuple(name for name, s in zip(body.markers.names, body.markers.segment, strict=True) if s == index)
        if sum(body.markers.segment[c] == index for c in case.marker_columns) < 4:
            return None
        place = _PLACE * middle
        loins = _PLACE / XIPHION * share_of_body(body, "middle_trunk", top=place, bottom=np.zeros(3))
        arms = tuple(i for i, joint in enumerate(body.joints) if joint.parent == body.segment_joint[index])
        extended = with_part(body, Cut("trunk_head", "thorax", _AXES, place, loins, on, arms), rest_moves=True)
        return doubting(extended, [name for name in body.markers.names if name.endswith(ELSEWHERE)])


EFFECT = TrunkJoint
