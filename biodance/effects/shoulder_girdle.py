"""The shoulders move on the trunk: shrugging, reaching; the model has them fixed."""

from biodance.body.body import Body
from biodance.body.changes import with_part
from biodance.body.human.skeleton import collar_bone, shoulders
from biodance.effects._base.case import Case
from biodance.effects._base.missing_joint import MissingJoint, angle_and_beyond, doubting
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.records import SIDES

SHOULDERS = ("RSHO", "LSHO")
"""Skin over the acromion follows the collar bone in part only, and how far is what is asked: the arm's markers show
where the joint is.
"""


class ShoulderGirdle(MissingJoint):
    """Both shoulders turn by ``angle`` (rad rms per axis) about the inner end of the collar bone, as their markers
    show; 0.1 rad carry the shoulder by 15 mm.
    """

    name = "shoulder_girdle"
    parameters = angle_and_beyond(
        0.10,
        "2-5 cm of the shoulder joint on the thorax (laboratory experience)",
        # rad that matter: as much as everybody moves it anyway (`natural`).
        least=0.06,
    )
    separated_by = "Shrugging alone, with hanging arms."
    advice = "Accept a body with collar bones; keep the shoulder markers on the acromion, not on the deltoid."
    about = About(
        what="The shoulders move on the trunk: shrugging, reaching; the model has them fixed.",
        signature=(
            "The arm's weight moves by centimetres against the model, mostly in Mx and My; the shoulder markers leave"
            " the trunk's."
        ),
        look_alikes=(
            "A misplaced shoulder marker (which does not come back), a centre of mass that is off in the upper arm."
        ),
        settled_by="Shrugging alone, with hanging arms.",
    )
    words = CauseWords("the shoulders move {size}{between} on the trunk", "Accept it.", "moving shoulders")
    explains = (CheckKind.MARKERS,)
    carries = ("right_shoulder", "left_shoulder")
    natural = 0.058
    """Root mean square of thirty virtual sessions (0.033 to 0.08), whose collar bones follow the arms."""

    @classmethod
    def extended_body(cls, case: Case) -> Body | None:
        """Return the body with two joints at the inner end of each collar bone that it lacks; None where the markers do
        not show both shoulders, or it has them both.
        """
        body = case.body
        seen = {body.markers.names[c] for c in case.marker_columns}
        missing = [side for side in SIDES if f"{side}_clavicle" not in body.links]
        if shoulders(body) is None or not seen.issuperset(SHOULDERS) or not missing:
            return None
        for side in missing:
            body = with_part(body, collar_bone(body, side))
        return doubting(body, SHOULDERS)


EFFECT = ShoulderGirdle
