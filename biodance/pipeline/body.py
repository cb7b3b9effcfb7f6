"""Who moves: the body scaled by a static trial or stature, its joints, and whether an earlier body is the same's."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.scaling import Scaling, measure_static
from biodance.body.human.skeleton import with_tracking_limits
from biodance.errors import SessionRefused, TrialRefused
from biodance.identification.added_mass import scaled_to_mass
from biodance.lab.markers.sets import read_marker_set
from biodance.motion.contact import carried_elsewhere
from biodance.motion.dynamics import predict_wrench
from biodance.motion.ik.functional_joints import PLACED, JointGain, functional_joints, with_shown_joints
from biodance.motion.track import track
from biodance.pipeline.trial import ON_A_FRAME, ForceGain, Step, TrialResult, attempt
from biodance.records import SIDES, Markers, Sip, Subject, Trial
from biodance.settings import Settings
from biodance.uncertainty.caution import in_other_frames

_NO_STATIC = (
    "No static trial can be used, so the body comes from stature alone or from one frame of a moving trial, "
    "whichever fits better. Record a static trial."
)
_NO_MARKERS = "No trial has markers, so only the plates are reported. Record the movement with markers to go further."


def body_of(
    subject: Subject, read: tuple[TrialResult, ...], settings: Settings, steps: list[Step]
) -> tuple[Body | None, str]:
    """Return the body of the session and one sentence on where it comes from; None without mass, stature or markers,
    with the step refused.

    Every static trial is tried in turn; where none can be used, lengths come from stature and markers from their usual
    places.
    """
    attempt(steps, "subject", partial(subject.require, "mass", "stature"))
    if steps[-1].status != "done":
        return None, "No body: the subject's mass or stature is not known."
    statics = [one.trial for one in read if one.trial.role == "static" and one.usable]
    for static in statics:
        scaling = attempt(steps, "scale", partial(measure_static, subject, static))
        if scaling is not None:
            scaling, how = _placed(scaling, read, settings, steps)
            return scaling.body()[0], (
                f"Scaled on the static trial {static.name}, {how}; masses and inertias from the table {settings.table}."
            )
    return _without_static(subject, read, settings, steps, had_static=bool(statics))


def _placed(
    scaling: Scaling, read: tuple[TrialResult, ...], settings: Settings, steps: list[Step]
) -> tuple[Scaling, str]:
    """Return the scaling with its joints where the movement shows them, if it does, and what places them in words."""
    moved_in = any(one.trial.role == "fit" and one.trial.markers is not None for one in read)
    functional = settings.joints == "functional" and moved_in
    placed = attempt(steps, "joints", partial(calibrate_joints, scaling, read)) if functional else None
    moved = placed is not None and any(note.startswith(PLACED) for note in placed.notes)
    how = f"{PLACED[:1].lower()}{PLACED[1:]}" if moved else "joints where it shows them"
    return placed or scaling, how


def _without_static(
    subject: Subject, read: tuple[TrialResult, ...], settings: Settings, steps: list[Step], *, had_static: bool
) -> tuple[Body | None, str]:
    """Return the body from stature, or scaled on a moving frame: whose markers lie nearer in that trial."""
    worn = [one.trial for one in read if one.usable and one.trial.markers is not None and one.trial.marker_set]
    if all(one.trial.markers is None for one in read):
        steps.append(Step("scale", "refused", _NO_MARKERS))
        return None, "No body: no trial has markers."
    # where there was one, its own refusal has said already why it does not scale the body
    if not had_static:
        steps.append(Step("scale", "refused", _NO_STATIC))
    if not worn:
        return None, "No body: no trial has markers of a known set."
    generic = partial(human, subject, table=settings.table, markers=worn[0].marker_set, gravity=settings.gravity)
    tables = f"masses and inertias from the table {settings.table}."
    body = attempt(steps, "body from stature", lambda: with_tracking_limits(generic()))
    usual = f"From stature alone, with the usual places of the markers; {tables}"
    choices = [(body, usual, list[Step]())] if body else []
    for trial in worn:
        scaling = attempt([], "scale", partial(measure_static, subject, trial))
        if scaling is not None:
            done = [Step(ON_A_FRAME, "done")]
            scaling, how = _placed(scaling, read, settings, done)
            said = f"Scaled on one frame of {trial.name}, with both feet on the ground, {how}; {tables}"
            choices.append((scaling.body()[0], said, done))
            break
    if not choices:
        return None, "No body."

    def distance(choice: tuple[Body, str, list[Step]]) -> float:  # RMS, m
        motion = attempt([], "track", partial(track, choice[0], worn[0]))
        return float(np.sqrt(np.nanmean(motion.residual**2))) if motion is not None else math.inf

    body, said, done = min(choices, key=distance)
    steps += done
    return body, said


def calibrate_joints(scaling: Scaling, read: tuple[TrialResult, ...]) -> Scaling:
    """Return the scaling with the joints that the trials with role fit show at the places where these show them. Raises
    TrialRefused: no trial with role fit has markers of the same set.
    """
    wanted = scaling.posture.marker_set.name
    fits = [one.trial for one in read if one.usable and one.trial.role == "fit" and one.trial.marker_set == wanted]
    same = [markers for trial in fits if (markers := _carried_by_plates(trial, scaling.subject.mass)) is not None]
    if not same:
        raise TrialRefused(
            "No trial with role fit has markers of the static trial's set, so the joints stay where that trial shows "
            "them."
        )
    return functional_joints(scaling, same).scaling


def _carried_by_plates(trial: Trial, mass: float) -> Markers | None:
    """Return a trial's markers, hidden while a chair carries: it pushes skin aside and bends the trunk."""
    if trial.markers is None or not trial.plates:
        return trial.markers
    xyz = np.array(trial.markers.xyz)
    xyz[carried_elsewhere(trial, weight=trial.settings.gravity * mass)] = np.nan
    return replace(trial.markers, xyz=xyz)


def starting_from(known: Body, body: Body, mass: float, source: str) -> tuple[Body, Sip, str]:
    """Return ``body`` with the inertial parameters of the same person's earlier body ``known``, at today's declared
    ``mass`` kg, what is known of them before today's data, and where the body comes from in words.

    Raises
    ------
    SessionRefused
        The earlier body has other segments, no uncertainty, or is another person's (`refuse_another_body`).
    """
    before = float(known.sip.mass.sum())
    if known.segments != body.segments or not np.any(known.sip.covariance):
        raise SessionRefused(
            f"Body {known.name}: is none that was identified from such a person ({len(known.segments)} segments, "
            f"{len(body.segments)} here). Give the body.json of `biodance identify`."
        )
    refuse_another_body(known, body, mass)
    prior = in_other_frames(scaled_to_mass(known.sip, mass), body.joint_errors)
    words = (
        f"Its masses and inertias are those of an earlier session ({before:.1f} kg there, {mass:.1f} kg here), which "
    )
    return replace(body, sip=prior), prior, f"{source} {words}stand where it says \u201ctable\u201d."


_WORDS = {
    "neck": "a neck",
    "forearms": "forearms that turn (pronation)",
    "wrists": "wrists",
    "clavicles": "collar bones",
}


def shown_joints(body: Body, read: tuple[TrialResult, ...], steps: list[Step]) -> tuple[Body, tuple[JointGain, ...]]:
    """Return the body with the joints that moving trials show, and what each brings to the markers; as it is where no
    static trial placed markers.
    """
    usable = [one.trial for one in read if one.usable]
    scaled = any(step.name == "scale" and step.status == "done" for step in steps)
    worn = next((trial.marker_set for trial in usable if trial.role == "static"), "") if scaled else ""
    moving = [trial.markers for trial in usable if trial.role != "static" and trial.marker_set == worn]
    recorded = tuple(markers for markers in moving if markers is not None)
    if not worn or not recorded:
        return body, ()
    landmarks = read_marker_set(worn).landmarks
    found = attempt(steps, "optional joints", partial(with_shown_joints, body, recorded, landmarks))
    if found is None:
        return body, ()
    wider, gains = found
    return replace(wider, notes=(*body.notes, *map(_sentence, gains))), gains


def force_gains(plain: Body, done: tuple[TrialResult, ...], earlier: tuple[ForceGain, ...]) -> tuple[ForceGain, ...]:
    """Return what the joints shown bring to the forces of every trial, against the ``plain`` body without them, whose
    motion is that of ``earlier`` ones.
    """
    forces, known = [], {one.trial: one.plain for one in earlier}
    for one in done:
        compared = one.comparison
        if compared is None or one.trial.role == "static" or not compared.used.any():
            continue
        # the plain body follows the same markers: what it leaves of the forces is without the joints
        motion = None if one.name in known else attempt([], "track", partial(track, plain, one.trial))
        needed = known.get(one.name) if motion is None else predict_wrench(plain, motion).value
        if needed is not None:
            left = (compared.measured - needed)[compared.used, :3]
            without = tuple(np.sqrt(np.mean(left**2, axis=0)).tolist())
            forces.append(ForceGain(one.name, without, tuple(compared.rms[:3].tolist()), needed))
    return tuple(forces)


def _sentence(gain: JointGain) -> str:
    fitted, without, with_it = (f"{1000 * value:.0f} mm" for value in (gain.fitted, gain.without, gain.with_it))
    start = f"{len(gain.markers)} markers lie {fitted} from a body without {_WORDS[gain.name].removeprefix('a ')}"
    held = f"left out one at a time, they are predicted to {without} without and to {with_it} with them"
    end = f"The body has {_WORDS[gain.name]}" if gain.taken else "No gain: the body goes without"
    return f"{start}; {held}. {end}."


ANOTHER_MASS = 0.15
"""Share of the body mass by which nobody differs from an earlier session: more is another person."""
ANOTHER_LEG = 0.04
"""The same of the length of the legs, mean of both sides: another day's markers and calibration change it by less than
1 %, a hip 50 mm from its place by 3 %.
"""


def refuse_another_body(known: Body, body: Body, mass: float) -> None:
    """Refuse an earlier body ``known`` of somebody else than the person of ``body``, declared as ``mass`` kg.

    Raises
    ------
    SessionRefused
        It weighs so much less or more, or its legs are so much shorter or longer, that it is another person's.
    """
    before = float(known.sip.mass.sum())
    if abs(mass / before - 1) > ANOTHER_MASS:
        raise SessionRefused(
            f"The body that was given weighs {before:.1f} kg, {mass:.1f} kg are declared here: it is of another "
            f"person. Give the same person's body.json."
        )
    if unlike := _unlike_legs(known, body):
        raise SessionRefused(f"The body that was given {unlike}. Give the same person's body.json.")


def refuse_another_reference(known: Body, body: Body, mass: float, name: str) -> None:
    """Refuse a reference session ``name`` with the body ``known`` of somebody else; one who weighs more here may carry
    a load.

    Raises
    ------
    SessionRefused
        It weighs so much more, or its legs are so much shorter or longer, that it is another person's.
    """
    before = float(known.sip.mass.sum())
    if mass < (1 - ANOTHER_MASS) * before:
        raise SessionRefused(
            f"The reference, session {name}, is of somebody of {before:.1f} kg, {mass:.1f} kg are declared here: it is "
            "of another person, or of this one with a load. Give an unloaded session of the same person."
        )
    if unlike := _unlike_legs(known, body):
        raise SessionRefused(f"The reference, session {name}, {unlike}. Give a session of the same person.")


def _unlike_legs(known: Body, body: Body) -> str:
    """Return how legs differ if they are of two persons, in words; "" if they need not be."""
    before, now = _leg(known), _leg(body)
    if not (before > 0 and now > 0) or abs(now / before - 1) <= ANOTHER_LEG:
        return ""
    legs = f"has legs of {before:.2f} m from hip to ankle, {now:.2f} m are measured here"
    return f"{legs}: it is of another person, or of one who has grown since"


def _leg(body: Body) -> float:
    """Return the length (m) from hip to knee to ankle, mean of both sides; 0 where a leg has neither."""
    # a joint's place in its parent: of the knee the length of the thigh, of the ankle that of the shank
    length = {joint.name: float(np.linalg.norm(joint.translation)) for joint in body.joints}
    ends = [f"{side}_{joint}" for side in SIDES for joint in ("knee_flexion", "ankle_dorsiflexion")]
    return sum(length[end] for end in ends) / len(SIDES) if all(end in length for end in ends) else 0.0
