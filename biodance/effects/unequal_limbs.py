"""One limb is lighter than the other: a prosthesis, a limb that has wasted."""

from dataclasses import replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.identification.loads import limb_and_rest, segments_beyond, with_open_limb
from biodance.lab.markers.sets import other_side
from biodance.records import Array, Subject
from biodance.uncertainty.caution import shift_slope

_ENDS = ("shank", "foot")
"""Segments where the lighter part of a leg may begin: thighs of intact people differ by more, and so do arms."""
_FARTHEST = 0.35
"""m by which the missing matter may lie beyond the middle of the limb: from there to the toes."""


class UnequalLimbs(Effect):
    """The limb from segment ``target`` on is ``lighter`` (kg) than that of the other side. A share ``beside`` of it the
    other limb weighs more than in the table, which knows both alike, the rest this one less; the body without both
    weighs what the two do not. The missing matter lies ``place`` (m) farther from the joint than that of the limb.
    """

    name = "unequal_limbs"
    prior = 0.03
    parameters = (
        Parameter(
            "lighter",
            "kg",
            1.0,
            "a transtibial prosthesis weighs a third to a half less than the limb that it replaces (Selles 1999)",
            # kg that matter: a tenth of a leg below the knee.
            least=0.5,
            # kg up to which people have it without calling it a fault: two legs below the knee
            # are known to be alike to 9 % (table of segments, 0.14 with a correlation of 0.8),
            # 0.4 kg.
            usual=0.5,
        ),
        Parameter("beside", "1", 0.2, "one limb has changed, whatever both weigh beside the table (14 %)"),
        Parameter("place", "m", 0.08, "a fifth of a shank: stump, tube and foot are no calf"),
    )
    separated_by = "Swing either leg alone, the rest standing still: both sides alike."
    advice = (
        'Write prosthesis = "left_shank" (the first segment of that limb) under [subject] in session.toml, weigh what '
        "is worn, and give it under [devices]."
    )
    about = About(
        what="One limb is lighter than the other: a prosthesis, or muscle lost after a cast or a stroke.",
        signature=(
            "The columns of that limb's regressor, which the other side does not have: moments in standing towards the "
            "heavier side, and too little force where the lighter limb swings; the weight is as declared."
        ),
        look_alikes="A load on the other side (which also weighs); a plate or joints shifted sideways.",
        settled_by="Swinging both limbs in turn, and by weighing the prosthesis.",
    )
    words = CauseWords(
        "the {it} is {size} lighter than the {opposite}{between}",
        "Declare the prosthesis, or what the other side wears.",
        "limbs that are unequal",
        places={"shank": "leg below the knee"},
    )
    explains = (CheckKind.FORCES,)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the first segments of a leg that may be lighter, of bodies that have both sides."""
        names = case.body.segments
        both = (end for end in _ENDS if {f"right_{end}", f"left_{end}"} <= set(names))
        return tuple(f"{side}_{end}" for end in both for side in ("right", "left"))

    def added(self, case: Case, theta: Array) -> Array:
        """Return (T, 6) the wrench that the missing matter does not need, and the rest of the body needs more."""
        own, other, rest = limb_and_rest(case.body, self.target, case.phi)
        index = 10 * case.body.segment_index(self.target)
        matter = case.phi[index : index + 10] / case.phi[index]
        # Matter of the first segment moved along the way from joint to centre of mass, per metre and kilogram.
        outwards = shift_slope(matter) @ matter[1:4] / np.linalg.norm(matter[1:4])
        own[index : index + 10] += theta[2] * outwards
        # Sum of the shares (b - 1) + b + (1 - 2 b) = 0: the declared weight is kept.
        return case.needed(theta[0] * ((theta[1] - 1) * own + theta[1] * other + (1 - 2 * theta[1]) * rest))

    def in_body(self, case: Case) -> Array:
        """Return the mass of the other limb less that of this one: a table that errs on one side is lighter, too."""
        segment, out = np.arange(len(case.body.segments)), np.zeros((len(case.body.segments), 10))
        for limb, sign in ((other_side(self.target), 1.0), (self.target, -1.0)):
            out[np.isin(segment, segments_beyond(case.body, limb)), 0] = sign
        return out.ravel()

    def corrected(self, case: Case, theta: Array) -> Case:
        """Return the case of a body whose limb is open (`with_open_limb`): how much lighter it is, the fit tells."""
        return replace(case, body=with_open_limb(case.body, self.target))

    @classmethod
    def declared(cls, subject: Subject, target: str) -> Subject:
        """Return the person with a prosthesis there."""
        return replace(subject, prosthesis=target)

    def reported(self, case: Case, theta: Array, sd: Array) -> tuple[tuple[str, float, float, str], ...]:
        """Return how much lighter the limb is: where the missing matter lies is hardly known."""
        return super().reported(case, theta, sd)[:1]

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether the limb is lighter, weighs something still, and misses what lies in it: between its joint and
        the toes.
        """
        limb = list(segments_beyond(case.body, self.target))
        part = case.phi.reshape(-1, 10)[limb]
        mass = part[:, 0]
        # Middle of the limb in the first posture; the frame of its first segment lies in its joint.
        pose = case.poses.at(slice(0, 1))
        middle = mass @ pose.points(limb, part[:, 1:4] / mass[:, None])[0] / mass.sum()
        nearest = -float(np.linalg.norm(middle - pose.position[0, limb[0]]))
        return bool(0 < theta[0] < mass.sum() and nearest < theta[2] < _FARTHEST)


EFFECT = UnequalLimbs
