"""Joint torques with the uncertainty that the inertial parameters leave in them.

The torque about a joint axis a through o is what the segments beyond it need less what the ground gives them,

    torque = sum over segments beyond of  a . (M - o x F),      [F, M] = W_segment phi - ground wrench, about the lab
    origin,

linear in the parameters: torque = Y phi - c, hence the covariance Y C Y'. It holds at the tracked motion and the
measured wrenches: errors of skin and plates in this very trial are not counted, those that went into the parameters
are.

How far every uncertain quantity was pulled from what was known before, and what it still means for the joints, is told
as particle physics ranks its nuisance parameters: pull = (value - prior value) / prior standard deviation; impact =
what one standard deviation of the quantity after the data does to a joint moment, all other quantities following it as
far as they hang together with it (their regression on it): for a quantity g' phi of standard deviation s, phi moves by
C g / s and the moment by Y C g / s. Squared and summed over quantities that do not hang together it is the variance of
the moment. After ATLAS and CMS, Procedure for the LHC Higgs boson search combination, ATL-PHYS-PUB-2011-11 (2011).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.identification.identification import Identification
from biodance.identification.knowledge import QUANTITIES, SIGMAS, segment_quantities
from biodance.motion.contact import foot_wrenches, ground_contact
from biodance.motion.dynamics import regressor_of
from biodance.motion.kinematics import below, in_blocks, poses, segment_motion
from biodance.motion.soles import soles_from_body
from biodance.records import Array, Motion, Trial, Wrench
from biodance.spatial import cross
from biodance.threads import one_thread


@dataclass(frozen=True, eq=False)
class TorqueBands:
    """Torques of the ``joints`` (n) of ``trial`` at ``time`` (T,) s: ``torque`` with ``sd`` and ``table`` (T, n) N·m
    along the positive sense of each joint, with the identified and with the table's parameters; ``use`` (T,) True where
    the ground is fully measured; NaN in frames whose posture is not determined, as ``state`` (T,) `AngleState` says.
    """

    trial: str
    joints: tuple[str, ...]
    time: Array
    torque: Array
    sd: Array
    table: Array
    use: NDArray[np.bool_]
    state: NDArray[np.int8]

    @property
    def half_width(self) -> Array:
        """(T, n) half of the 95 % intervals, N·m."""
        return SIGMAS * self.sd


def torque_bands(
    found: Identification, motion: Motion, ground: Mapping[str, Wrench], *, trial: str, use: NDArray[np.bool_]
) -> TorqueBands:
    """Return the torques of ``motion`` under the ``ground`` wrenches (segment name -> wrench on it about the lab
    origin).

    Raises
    ------
    UnknownName
        A segment is not of this body.
    """
    body = found.body
    share = np.eye(10 * len(body.segments)) if body.sharing is None else body.sharing
    covariance, phi = (
        share @ found.posterior.covariance @ share.T,
        share @ np.stack([found.sip.phi, body.sip.phi], axis=1),
    )
    needed, variance = np.empty((motion.time.size, len(body.joints), 2)), np.empty((motion.time.size, len(body.joints)))
    for part, frames in in_blocks(motion):
        for j, (beyond, Y) in enumerate(_beyond_joints(body, frames)):
            needed[part, j] = Y @ phi[beyond]
            # Diagonal of Y C Y': variance of each frame's torque.
            variance[part, j] = ((Y @ covariance[np.ix_(beyond, beyond)]) * Y).sum(axis=1)
    known = np.where(motion.determined, 1.0, np.nan)[:, None]
    torque, table = np.moveaxis(needed - ground_torques(body, motion, ground)[..., None], 2, 0)
    joints, sd = tuple(joint.name for joint in body.joints), np.sqrt(np.maximum(variance, 0.0))
    return TorqueBands(trial, joints, motion.time, known * torque, known * sd, known * table, use, motion.frame_state)


def _beyond_joints(body: Body, motion: Motion) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Yield for each joint the parameters of the links beyond it and what these need about its axis (T, k)."""
    Y = _about_axes(_axes(body, motion), regressor_of(segment_motion(body, motion), gravity=body.gravity))
    for j, hangs in enumerate(below(body)):
        beyond = np.flatnonzero(np.repeat(hangs, 10))
        yield beyond, Y[:, j, beyond]


def torque_regressor(body: Body, motion: Motion) -> Array:
    """Return Y (T, n, 10N): what each parameter needs about each joint's axis, N·m per unit."""
    Y = torque_regressor_of_links(body, motion)
    return np.asarray(Y if body.sharing is None else Y @ body.sharing)


def torque_regressor_of_links(body: Body, motion: Motion, joints: Sequence[int] | None = None) -> Array:
    """Return Y (T, n, 10L): the same for the parameters of the links (`Body.links`), of which a segment has several
    where it has parts; about the axes of some ``joints`` (n,), by default all.
    """
    W = regressor_of(segment_motion(body, motion), gravity=body.gravity)
    some = list(range(len(body.joints)) if joints is None else joints)
    axis, arm = (part[:, some] for part in _axes(body, motion))
    # Links that do not hang on the joint have no part in its torque.
    return np.asarray(_about_axes((axis, arm), W) * np.repeat(below(body)[some], 10, axis=1))


def ground_torques(body: Body, motion: Motion, ground: Mapping[str, Wrench]) -> Array:
    """Return (T, n) N·m: what the ground's wrenches give about each joint's axis."""
    total = np.zeros((motion.time.size, len(body.joints)))
    for part, frames in in_blocks(motion):
        axes = _axes(body, frames)
        for segment, wrench in ground.items():
            beyond = below(body)[:, body.segment_index(segment)]
            total[part] += beyond * _about_axes(axes, wrench.value[part, :, None])[..., 0]
    return total


def _about_axes(axes: tuple[Array, Array], wrench: Array) -> Array:
    """Return the moments (T, n, k) about the joint axes of wrenches (T, 6, k) about the lab origin: a . (M - o x F)."""
    axis, arm = axes
    # a.(M - o x F) = a.M - (a x o).F.
    return np.asarray(axis @ wrench[:, 3:] - arm @ wrench[:, :3])


def _axes(body: Body, motion: Motion) -> tuple[Array, Array]:
    """Return the joints' axes a (T, n, 3) and a x o (T, n, 3) m, o a point on the axis, lab frame."""
    pose = poses(body, motion.q)
    own = np.array([joint.axis for joint in body.joints]).reshape(-1, 3)
    axis = np.einsum("tjab,jb->tja", pose.joint_rotation, own)
    return axis, cross(axis, pose.joint_position)


@one_thread()
def torques_on_plates(found: Identification, trial: Trial, motion: Motion, use: NDArray[np.bool_]) -> TorqueBands:
    """Return the joint torques of a prepared ``trial`` with the identified body: what each foot carries, and what the
    segments beyond need; ``use`` (T,) the frames that were compared.
    """
    soles = soles_from_body(found.body, motion)
    ground = foot_wrenches(trial, ground_contact(trial, soles, mass=found.sip.mass.sum()), soles)
    return torque_bands(found, motion, ground, trial=trial.name, use=use)


_JOINTS = ("knee_flexion", "hip_flexion")
_FRAMES = 400
"""Frames, about, from which a root mean square is taken."""


@dataclass(frozen=True)
class Impact:
    """One quantity of a ``segment``: its ``pull`` and its standard deviation after the data ``left``, both in prior
    standard deviations; ``knee``, ``hip`` N·m, RMS over the used frames of the flexion moment that one standard
    deviation of it after the data adds, on the side where that is more.
    """

    segment: str
    quantity: str
    pull: float
    left: float
    knee: float
    hip: float


def impacts(found: Identification, motion: Motion, use: NDArray[np.bool_]) -> tuple[Impact, ...]:
    """Return every quantity of every segment in the frames ``use`` (T,) of ``motion``, the largest impact first; ()
    where no knee or hip bends or no frame is used.
    """
    names = [joint.name for joint in found.body.joints]
    of = {kind: [i for i, name in enumerate(names) if name.endswith(kind)] for kind in _JOINTS}
    if not use.any() or not all(of.values()):
        return ()
    at = np.flatnonzero(use)
    at = at[:: max(1, at.size // _FRAMES)]
    frames = motion.at(at)
    joints = [i for kind in _JOINTS for i in of[kind]]
    Y = torque_regressor(found.body, frames)[:, joints]
    moved, sd = _moved(found)
    # Y C g / s of every quantity at once; RMS over the frames.
    added = np.sqrt(np.mean((Y.reshape(-1, Y.shape[2]) @ moved).reshape(len(Y), len(joints), -1) ** 2, axis=0))
    knee, hip = added[: len(of["knee_flexion"])].max(axis=0), added[len(of["knee_flexion"]) :].max(axis=0)
    rows = [
        Impact(
            known.segment,
            known.quantity,
            (known.value - known.table) / known.table_sd,
            known.sd / known.table_sd,
            float(knee[k]),
            float(hip[k]),
        )
        for k, known in enumerate(found.known)
        if known.table_sd > 0 and sd[k] > 0
    ]
    return tuple(sorted(rows, key=lambda row: -max(row.knee, row.hip)))


def _moved(found: Identification) -> tuple[Array, Array]:
    """Return by how much parameters move (10N, 10N) per standard deviation of each of ``found.known``, and these."""
    C, size = found.posterior.covariance, len(QUANTITIES)
    slopes = np.zeros_like(C)
    for i in range(len(found.sip.segments)):
        cut = slice(size * i, size * i + size)
        slopes[cut, cut] = segment_quantities(found.sip.phi[cut])[1].T
    # Column k is C g_k; divided by its standard deviation the move of phi per standard deviation of quantity k.
    together = C @ slopes
    # g_k' C g_k: sum over p of slopes[p, k] together[p, k].
    sd = np.sqrt(np.maximum(np.einsum("pk,pk->k", slopes, together), 0.0))
    return np.divide(together, sd, out=np.zeros_like(together), where=sd > 0), sd
