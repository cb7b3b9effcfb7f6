"""Soft tissue swings on the bones: viscera in the trunk, muscle and fat on the thighs."""

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.oscillator import oscillator_wrench, point_motion, relative_motion
from biodance.effects._base.words import About, CauseWords
from biodance.records import Array

_FREQUENCY = {"trunk_head": 5.0}
"""Hz: main resonance of the upright body under vertical vibration, 4 to 6 Hz (Griffin 1990, Handbook of Human
Vibration).
"""
LIMBS = 10.0
"""Hz: lowest resonances of the soft tissue of thigh and shank, 10 to 50 Hz (Wakeling & Nigg 2001, DOI
10.1152/jappl.2001.90.2.412).
"""


class WobblingMass(Effect):
    """A ``mass`` (kg) of segment ``target`` that hangs on a damped spring at the segment's centre of mass instead of
    being rigid.
    """

    name = "wobbling_mass"
    parameters = (
        Parameter(
            "mass",
            "kg",
            4.0,
            "a third to a half of trunk and thigh swings (Masters & Challis 2022, running)",
            # kg that matter, by judgement.
            least=0.5,
        ),
    )
    separated_by = "Hops, heel drops and sudden stops: only content above 5 Hz shows it."
    advice = "Add three heel drops to the session and read them with a cut-off of 20 Hz or more."
    about = About(
        what="Soft tissue swings on the bones: viscera in the trunk, muscle and fat on the thighs.",
        signature=(
            "Part of the segment's mass follows the bone as a damped spring does: the residual is the change of the "
            "segment's acceleration, largest at the fast ends of movements and in landings, nothing in holds and slow"
            " movements."
        ),
        look_alikes="Another filter on forces than on markers; a delay; an error of that segment's mass.",
        settled_by="Hops and heel drops, which excite more than 5 Hz; below that even ten kilograms hardly show.",
    )
    size_error = 0.4
    """Slow movement shows the mass over the square of its resonance: 4 to 6 Hz, not 5, are 40 % of it."""
    words = CauseWords("{size}{between} of soft tissue swing at the {it}", "Accept it.", "soft tissue")

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the trunk, thighs and shanks; every segment of a body that has none of these."""
        soft = tuple(name for name in case.body.segments if name.endswith(("trunk_head", "thigh", "shank")))
        return soft or case.body.segments

    def columns(self, case: Case) -> Array:
        """Return the wrench per kilogram of the mass's motion relative to the bone."""
        index = case.body.segment_index(self.target)
        table = case.phi[10 * index : 10 * index + 10]
        # The mass hangs at the segment's centre of mass, h / m.
        place, acceleration = point_motion(case, index, table[1:4] / table[0])
        moved = relative_motion(
            acceleration, case.motion.rate, frequency=_FREQUENCY.get(self.target, LIMBS), damping=0.3
        )
        return oscillator_wrench(place, acceleration, moved, gravity=case.body.gravity)[:, :, None]

    def possible(self, theta: Array) -> bool:
        """Return whether the size is positive: only a mass that is there wobbles."""
        return bool(theta[0] > 0)

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether no more wobbles than the segment weighs."""
        return bool(0 < theta[0] <= case.body.sip.mass[case.body.segment_index(self.target)])


EFFECT = WobblingMass
