"""From the markers of a trial to the motion of a body: inverse kinematics frame by frame, then smoothing."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.errors import TrialRefused
from biodance.lab.filters import motion_filter
from biodance.motion.angle_state import angle_states
from biodance.motion.ik.determination import determination
from biodance.motion.ik.inverse_kinematics import FrameStatus, InverseKinematics, solve_ik
from biodance.motion.kinematics import poses
from biodance.motion.smoothing import smooth
from biodance.records import Array, Markers, Motion, Trial
from biodance.spatial import elementary_rotation, zxy_angles
from biodance.threads import one_thread

_STRIDE = 1.0
"""s over which the direction that the pelvis faces is averaged: about one stride, in which it turns to and fro."""


def upright_trunk(body: Body, q: Array, rate: float) -> Array:
    """Return postures q (T, nq) at ``rate`` Hz with the unseen trunk upright, facing as the pelvis does on average.

    The body is returned to as it is where the trunk is seen, or is no ball joint.
    """
    chain = [i for i, joint in enumerate(body.joints) if joint.name.rsplit("_", 1)[0] == "trunk"]
    if len(chain) != 3 or body.free[chain].any():
        return q
    pelvis = poses(body, q).rotation[:, 0]
    facing = np.unwrap(np.arctan2(pelvis[:, 1, 0], pelvis[:, 0, 0]))
    width = min(len(q), max(1, round(_STRIDE * rate)))
    heading = uniform_filter1d(facing, width, mode="nearest") if len(q) > 1 else facing
    relative = np.swapaxes(pelvis @ body.joints[chain[0]].rotation, 1, 2) @ (
        elementary_rotation("z", heading) @ UPRIGHT
    )
    out = np.array(q)
    first = body.nq - len(body.joints)
    signs = [float(body.joints[i].axis.sum()) for i in chain]
    for i, sign, angle in zip(chain, signs, zxy_angles(relative), strict=True):
        out[:, first + i] = sign * angle
    return out


@one_thread()
def track(body: Body, trial: Trial) -> Motion:
    """Return the motion of a body under the markers of a trial, matched by name, low-passed as ``trial.settings`` say.

    Parameters
    ----------
    body : Body
        Who moves, with its markers.
    trial : Trial
        With markers, best prepared (gaps filled).

    Returns
    -------
    Motion
        ``residual`` (T, K) m are the distances before smoothing, of the markers that both share; ``determined`` (T,) is
        False where a frame's own markers leave its posture open or do not let it settle; ``state`` (T, n) says it of
        every angle; ``notes`` say so.

    Raises
    ------
    TrialRefused
        The trial has no markers, no frame with enough of them (the missing ones are named), or too few or uneven frames
        to smooth.

    References
    ----------
    Multi-body optimisation: Lu & O'Connor 1999, doi:10.1016/S0021-9290(98)00158-4; docs/derivations.md.

    Examples
    --------
    >>> biodance.track(biodance.scale(session.subject, session["static"]), session["squat_1"])
    Motion(23 joint angles, 611 frames at 100 Hz, 6.10 s)
    """
    if trial.markers is None or not trial.markers.time.size:
        raise TrialRefused(
            f"Trial {trial.name}: no markers were recorded, so there is no motion. Export the trial with its markers."
        )
    try:
        followed, held = hold_open(body, trial.markers)
        found = solve_ik(followed, trial.markers)
        rate = trial.markers.rate if trial.markers.time.size > 1 else 1.0
        postures = upright_trunk(followed, found.q, rate)
        low_pass = motion_filter(trial.settings)
        motion = smooth(followed, trial.markers.time, postures, settings=low_pass)
    except TrialRefused as error:
        raise TrialRefused(f"Trial {trial.name}: {error}") from error
    determined, state = angle_states(followed, trial.markers, found.status, low_pass)
    return replace(
        motion,
        residual=found.residual,
        marker_names=found.marker_names,
        determined=determined,
        state=state,
        notes=(*_notes(body, found), *held),
    )


_LEGS = ("hip", "knee", "ankle")


def hold_open(body: Body, markers: Markers) -> tuple[Body, tuple[str, ...]]:
    """Return the body for one trial, joints of trunk and arms that its markers leave open held in the neutral posture,
    and a warning that names them; unchanged where pelvis or legs are open too.
    """
    columns = [k for k, name in enumerate(body.markers.names) if name in markers]
    seen = markers.select(body.markers.names[k] for k in columns).seen
    vague: set[str] = set()
    for _ in range(len(body.joints)):
        verdict = determination(body.holding(vague, body.neutral), columns, seen)
        more = {name for name in verdict.open_coordinates if not name.startswith("root")}
        if verdict.determined.any() or not more or len(more) < len(verdict.open_coordinates):
            break
        vague |= more
    if not vague or not verdict.determined.any() or any(name.split("_")[1] in _LEGS for name in vague):
        return body, ()
    listed = ", ".join(name.replace("_", " ") for name in sorted(vague))
    return body.holding(vague, body.neutral), (
        f"Warning: the markers of this trial do not determine {listed}: held straight; what they do is not known.",
    )


def _notes(body: Body, found: InverseKinematics) -> tuple[str, ...]:
    frames, names = len(found.q), found.marker_names
    seen = ~np.isnan(found.residual)
    rms = np.sqrt(np.mean(found.residual[seen] ** 2))
    frame, marker = np.unravel_index(np.where(seen, found.residual, -1.0).argmax(), found.residual.shape)
    notes = [
        f"Inverse kinematics: {frames} frames, {len(names)} markers, RMS distance {1e3 * rms:.1f} mm, "
        f"largest {1e3 * found.residual[frame, marker]:.1f} mm ({names[marker]}, frame {frame})."
    ]
    absent = [name for name in body.markers.names if name not in names]
    if absent:
        notes.append(f"Markers of the body that the trial does not have: {', '.join(absent)}.")
    for status, text in (
        (FrameStatus.LEANING, "lean on their neighbours, because their own markers leave the posture open"),
        (FrameStatus.STOPPED, "did not settle at a minimum; look at their residuals"),
    ):
        count = int((found.status == status).sum())
        if count:
            notes.append(f"{count} of {frames} frames {text} (first: frame {int((found.status == status).argmax())}).")
    return tuple(notes)
