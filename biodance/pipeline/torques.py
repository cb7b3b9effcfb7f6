"""Joint torques of one trial with the identified body: what each foot carries, and what the segments beyond need."""

from biodance.identification.identification import Identification
from biodance.identification.torques import TorqueBands, torque_bands
from biodance.motion.contact.contact import foot_wrenches, ground_contact
from biodance.motion.contact.soles import soles_from_body
from biodance.pipeline.trial_result import TrialResult
from biodance.records import SIDES
from biodance.threads import one_thread


@one_thread()
def torques_in(found: Identification, one: TrialResult) -> TorqueBands:
    """Return the joint torques of a trial whose motion and wrench were compared, with the identified body."""
    assert one.motion is not None
    assert one.comparison is not None
    soles = soles_from_body(found.body, one.motion)
    feet = foot_wrenches(one.trial, ground_contact(one.trial, soles, mass=found.sip.mass.sum()), soles)
    ground = {f"{side}_foot": wrench for side, wrench in zip(SIDES, feet, strict=True)}
    return torque_bands(found, one.motion, ground, trial=one.trial.name, use=one.comparison.used)
