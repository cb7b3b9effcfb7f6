"""The head moves on the trunk; the model has trunk and head in one piece."""

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import Cut, with_part
from biodance.body.human.skeleton import neck_and_vertex, share_of_body
from biodance.effects._base.case import Case
from biodance.effects._base.missing_joint import MissingJoint, angle_and_beyond
from biodance.effects._base.words import About, CauseWords, CheckKind

_AXES = {"neck_flexion": -np.eye(3)[2], "neck_bending": np.eye(3)[0], "neck_rotation": np.eye(3)[1]}


class HeadJoint(MissingJoint):
    """The head turns by ``angle`` (rad rms per axis) on the trunk, in the course of time that its markers show."""

    name = "head_joint"
    parameters = angle_and_beyond(
        0.10,
        "5-15 deg rms of head movement in whole-body tasks (laboratory experience)",
        # rad that matter: as much as everybody moves it anyway (`natural`).
        least=0.05,
    )
    separated_by = "Nodding and turning the head alone, standing still."
    advice = "Accept a body with a neck, or ask the person to look at one point straight ahead."
    about = About(
        what="The head moves on the trunk; the model has trunk and head in one piece.",
        signature=(
            "Five kilograms that follow the head markers instead of the trunk: mostly Mx and My, and Mz when the head"
            " turns; the head markers leave the model together."
        ),
        look_alikes="Skin that slides under C7, a centre of mass of the trunk that is too high or low.",
        settled_by="Nodding and turning the head alone, and by asking the person to look at one point.",
    )
    words = CauseWords("the head turns {size}{between} where the model is stiff", "Accept it.", "a turning head")
    explains = (CheckKind.MARKERS,)
    natural = 0.045
    """Root mean square of thirty virtual sessions, whose head nods by 2.5 deg on two axes."""

    @classmethod
    def extended_body(cls, case: Case) -> Body | None:
        """Return the body with three joints in the neck; None where the markers do not show the head, or it has
        them.
        """
        body, places = case.body, neck_and_vertex(case.body)
        seen = tuple(body.markers.names[c] for c in case.marker_columns if body.markers.names[c].endswith("HD"))
        if places is None or len(seen) < 3 or "head" in body.links:
            return None
        neck, vertex = places
        head = share_of_body(body, "head", top=vertex, bottom=neck)
        return with_part(body, Cut("trunk_head", "head", _AXES, neck, head, seen))


EFFECT = HeadJoint
