"""The joints beyond its 23 axes that the body of a session has because its markers show them, and what they bring."""

from dataclasses import replace
from functools import partial

import numpy as np

from biodance.body.body import Body
from biodance.lab.markers.sets import read_marker_set
from biodance.motion.optional_joints import JointGain, with_shown_joints
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.trial import Prepared, attempt, track_trial
from biodance.pipeline.trial_result import ForceGain, ShownJoints, Step, TrialResult

_WORDS = {
    "neck": "a neck",
    "forearms": "forearms that turn (pronation)",
    "wrists": "wrists",
    "clavicles": "collar bones",
}


def shown_joints(body: Body, read: tuple[Prepared, ...], steps: list[Step]) -> tuple[Body, ShownJoints]:
    """Return the body with the joints that the markers of its moving trials show, and what each brings; as it is where
    no static trial placed its markers, or nothing moves.
    """
    statics = [one.trial for one in read if one.usable and one.trial.role == "static"]
    worn = (
        statics[0].marker_set
        if statics and any(step.name == "scale" and step.status == "done" for step in steps)
        else ""
    )
    moving = [
        one.trial.markers for one in read if one.usable and one.trial.role != "static" and one.trial.marker_set == worn
    ]
    recorded = tuple(markers for markers in moving if markers is not None)
    if not worn or not recorded:
        return body, ShownJoints()
    landmarks = read_marker_set(worn).landmarks
    found = attempt(steps, "optional joints", partial(with_shown_joints, body, recorded, landmarks))
    if found is None:
        return body, ShownJoints()
    wider, gains = found
    return replace(wider, notes=(*body.notes, *map(_sentence, gains))), ShownJoints(gains)


def with_forces(shown: ShownJoints, plain: Body, body: Body, done: tuple[TrialResult, ...]) -> tuple[Body, ShownJoints]:
    """Return the body and its joints with what these bring to the vertical force of every trial that was compared,
    against the ``plain`` body without them.
    """
    if not shown.taken:
        return body, shown
    forces = tuple(gain for one in done for gain in _force_gain(plain, one))
    return replace(body, notes=(*body.notes, *_of_forces(forces))), replace(shown, forces=forces)


def _force_gain(plain: Body, one: TrialResult) -> list[ForceGain]:
    compared = one.comparison
    if compared is None or one.trial.role == "static" or not compared.used.any():
        return []
    motion = attempt([], "track", lambda: track_trial(one.trial, plain))
    if motion is None:
        return []
    left = (compared.measured - predict_wrench(plain, motion).value)[compared.used, :3]
    return [ForceGain(one.name, tuple(np.sqrt(np.mean(left**2, axis=0)).tolist()), tuple(compared.rms[:3].tolist()))]


def _sentence(gain: JointGain) -> str:
    fitted, without, with_it = (f"{1000 * value:.0f} mm" for value in (gain.fitted, gain.without, gain.with_it))
    start = f"{len(gain.markers)} markers lie {fitted} from a body without {_WORDS[gain.name].removeprefix('a ')}"
    held = f"left out one at a time, they are foretold to {without} without and to {with_it} with them"
    end = f"The body has {_WORDS[gain.name]}" if gain.taken else "No gain: the body goes without"
    return f"{start}; {held}. {end}."


def _of_forces(forces: tuple[ForceGain, ...]) -> tuple[str, ...]:
    """Return in one sentence what the joints bring to the forces: horizontal, and vertical."""
    if not forces:
        return ()
    without, with_them = (np.array([getattr(one, name) for one in forces]) for name in ("without", "with_them"))
    told = []
    for name, axes in (("horizontal", slice(0, 2)), ("vertical", slice(2, 3))):
        before, after = (float(np.sqrt(np.mean(np.sum(x[:, axes] ** 2, axis=1)))) for x in (without, with_them))
        change = 100 * (after / before - 1)
        word = "does not change" if abs(change) < 1 else f"{'falls' if change < 0 else 'grows'} by {abs(change):.0f} %"
        told.append(f"that of the {name} force {word} ({before:.1f} to {after:.1f} N)")
    return (
        f"Measured and simulated forces chose none of these joints; their RMS difference with them: {', '.join(told)}.",
    )
