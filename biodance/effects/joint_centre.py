"""A joint turns about another point than the model's."""

from dataclasses import replace

import numpy as np

from biodance.body.changes import recentre_joint
from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.geometry import joint_chains
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.motion.ik.joint_unknowns import MISMARKED, MISSED
from biodance.motion.track import track
from biodance.records import Array

_NAME = "joint_centre"
_ALIKE = {
    "hip": (("segment_length", "thigh"), (_NAME, "knee")),
    "knee": (("segment_length", "thigh"), ("segment_length", "shank"), (_NAME, "hip")),
    "ankle": (("segment_length", "shank"), (_NAME, "knee")),
    "shoulder": (("segment_length", "upper_arm"), (_NAME, "elbow")),
    "elbow": (("segment_length", "upper_arm"), (_NAME, "shoulder")),
}  # fmt: skip
"""What else looks like a joint that lies elsewhere, on the same side."""
_PLACED_BY = {"knee": "KNE", "ankle": "ANK", "shoulder": "SHO", "elbow": "ELB"}
"""The marker by which the static trial places a joint: wrong there and in all trials, it is that joint elsewhere."""


class JointCentre(Effect):
    """A ``shift`` (x, y, z: m, axes of the segment nearer to the root) from the model's centre of joint ``target``
    to the true one.
    """

    name = _NAME
    prior = MISMARKED
    parameters = tuple(
        Parameter(
            f"shift_{axis}",
            "m",
            MISSED,
            "hip: 12.3 mm (Harrington) to 25 mm (Davis) of error (Mantovani 2016)",
            # m that matter: who places markers twice places them 4 to 6 mm apart (Della Croce
            # 1999, doi:10.1007/BF02513272).
            least=0.005,
        )
        for axis in "xyz"
    )
    taken_up_by_calibration = True
    separated_by = "The joint alone through its whole range, about all its axes, the rest standing still."
    advice = (
        "Record a functional calibration of this joint (for the hip a star and an arc), or palpate and re-place "
        "its markers."
    )
    about = About(
        what=(
            "A joint turns about another point than the model's: regressions, functional trials and palpation miss "
            "joint centres by centimetres."
        ),
        signature=(
            "What hangs on the joint lies elsewhere in proportion to how far the joint is bent, so the moment follows"
            " the joint's angle; the markers beyond the joint leave the model in the same measure. In the posture of "
            "the static trial nothing shows."
        ),
        look_alikes=(
            "A misplaced marker of the same segment, another length of the bone, a centre of mass that is off in the "
            "segments that meet there."
        ),
        settled_by=(
            "Turning this joint through its whole range about all its axes (hip: star-arc) while the rest stands still."
        ),
    )
    words = CauseWords(
        "the {it} lies {size}{between} from where the static trial puts it",
        "Check the markers beside it.",
        "a joint elsewhere",
    )
    explains = (CheckKind.PRESSURE, CheckKind.MARKERS)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every anatomical joint of a segment that is followed; none without markers."""
        body, count = case.body, len(case.body.segments)
        chains = joint_chains(body).items() if case.marker_columns else ()
        return tuple(
            name for name, chain in chains if body.free[list(chain)].any() and body.joints[chain[-1]].segment < count
        )

    def columns(self, case: Case) -> Array:
        """Return the change of the wrench with the posture that the markers give the true body, per metre."""
        return np.asarray(case.geometry.joint_changes.wrench[..., self._own(case)], dtype=float)

    def marker_columns(self, case: Case) -> Array:
        """Return what the model with the wrong centre leaves of the markers, per metre."""
        return -case.geometry.joint_changes.residual[..., self._own(case)]

    @classmethod
    def looks_like(cls, joint: str, markers: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
        """Return effects and targets that look the same as ``joint`` elsewhere: a bone of another length, its other
        joint, and the one of the ``markers`` that places it in the static trial.
        """
        side, _, kind = joint.partition("_")
        own = f"{side[:1].upper()}{_PLACED_BY.get(kind, '')}"
        alike = tuple((effect, f"{side}_{name}") for effect, name in _ALIKE.get(kind, ()))
        return *alike, *(("marker_misplaced", name) for name in markers if name == own)

    def corrected(self, case: Case, theta: Array) -> Case:
        """Return the trial tracked again with the body whose centre is moved by ``theta`` (3,) m."""
        body = recentre_joint(case.body, joint_chains(case.body)[self.target][0], theta)
        shift = body.sip.phi - case.body.sip.phi
        return replace(case, body=body, motion=track(body, case.trial), phi=case.phi + shift)

    def _own(self, case: Case) -> slice:
        """Return the columns of this joint's centre in ``Geometry.joint_changes``."""
        first = 4 * list(joint_chains(case.body)).index(self.target)
        return slice(first, first + 3)


EFFECT = JointCentre
