"""What the instruments record of a performance. Cameras: markers with skin and fat between them and the bone, noise,
gaps. Plates as an AMTI BP400600 (z down, origin under the surface): true wrench and place, gain, cross-talk, offset,
noise, delay, converter; TYPE 2 as Vicon writes it, or volts with the calibration matrix of a real unit as TYPE 4.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.parts import GRAVITY
from biodance.lab.c3d.write import PlateRecording
from biodance.motion.kinematics import poses
from biodance.records import Array, Markers
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.person import Person, reference_angles, skeleton

SWING = {"THI": 9.0, "UPA": 10.0, "TIB": 12.0, "FRM": 14.0}
"""Hz, natural frequency of flesh and marker where muscle lies under the skin: 9 Hz sags by 3 mm under gravity.
Judgement, set so that fast squats leave residuals of the size of those in Bonnet et al. (2016, Table II).
"""


TISSUES = {"pulled": (1.0, 1.0, 0.0), "swinging": (0.4, 3.0, 0.0), "wavy": (0.3, 1.0, 1.0)}
"""Kinds of soft tissue: how many times as large as usual its pull by the joints, its swing under acceleration, and
waves at frequencies of their own (Cheze 1995, doi:10.1016/0021-9290(94)00072-D) are.
"""
_WAVES = (1.0, 8.0)  # rad/s between which the frequencies of waves lie: those of whole-body movement
_BENT = 0.5  # rad: a wave is as large as what a joint pulls that is bent so far


@dataclass(frozen=True, eq=False)
class SoftTissue:
    """Coefficients of one person in one session: ``pull`` (n, K, 3) m/rad per true joint; ``sag`` (K,) s² multiplies
    the specific force; ``wave`` (3, K, 3) amplitude m, frequency rad/s and phase rad per axis.
    """

    pull: Array
    sag: Array
    wave: Array


def draw_soft_tissue(person: Person, session: int, tolerances: skeleton.LabTolerances, tissue: str) -> SoftTissue:
    """Draw the coefficients of a kind of ``tissue`` (`TISSUES`): most belong to the person, a share of their variance
    to the day (clothes, tape, place on the skin).
    """
    joints = [joint.name for joint in person.body.joints]
    markers = person.body.markers
    scale = np.zeros((len(joints), len(markers.names)))
    swing = np.zeros(len(markers.names))
    for k, (name, segment) in enumerate(zip(markers.names, markers.segment, strict=True)):
        kind = next(
            (k for k in skeleton.ARM_AND_LEG if skeleton.TRUE_SEGMENTS[segment].endswith(k)),
            skeleton.TRUE_SEGMENTS[segment],
        )
        side = "right" if name.startswith("R") else "left"
        pulls = dict(skeleton.virtual_people()["pull_mm_rad"][kind])
        if name.endswith(("SHO", "BAK")):
            # mm per rad: the shoulder blade slides on the thorax
            pulls |= {"shoulder_flexion": 12.0, "shoulder_adduction": 12.0}
        for joint, millimetres in pulls.items():
            full = joint if joint in joints else f"{side}_{joint}"
            # Three independent components: the length of the vector has the given root mean square.
            scale[joints.index(full), k] = 0.001 * millimetres / np.sqrt(3.0)
        swing[k] = 2 * np.pi * SWING.get(name[1:], 16.0)  # Hz where bone lies under the skin
    own, day = skeleton.stream(person.seed, "soft tissue"), skeleton.stream(person.seed, "soft tissue", str(session))
    share = tolerances.soft_tissue_day
    shape = (*scale.shape, 3)
    # Shares of the variance, so roots of the amplitudes; the variance stays one.
    direction = np.sqrt(1 - share) * own.normal(size=shape) + np.sqrt(share) * day.normal(size=shape)
    # Lognormal about one.
    soft = np.exp(
        0.3 * (np.sqrt(1 - share) * own.normal(size=swing.size) + np.sqrt(share) * day.normal(size=swing.size))
    )
    pulled, swinging, waving = TISSUES[tissue]
    waves = skeleton.stream(person.seed, "waves", str(session))
    wave = np.stack(
        [
            waving * tolerances.soft_tissue * _BENT * scale.max(axis=0)[:, None] * waves.normal(size=(swing.size, 3)),
            waves.uniform(*_WAVES, size=(swing.size, 3)),
            waves.uniform(0, 2 * np.pi, size=(swing.size, 3)),
        ]
    )
    pull = pulled * tolerances.soft_tissue * scale[..., None] * direction
    # Static displacement of a spring: specific force over w².
    return SoftTissue(pull, swinging * tolerances.soft_tissue * soft / swing**2, wave)


def film(
    performance: Performance,
    tissue: SoftTissue,
    time: Array,
    tilt: Array,
    tolerances: skeleton.LabTolerances,
    rng: np.random.Generator,
) -> Markers:
    """Return what the cameras deliver at ``time`` (T,) s, lab frame; ``tilt`` (3, 3) turns true-vertical axes into the
    laboratory's.

    Gaps come in every trial except the static one, which every laboratory repeats until it is complete.
    """
    from scipy.interpolate import make_interp_spline

    # the true markers, true vertical: fixed to the bone, plus what skin adds
    motion, person = performance.motion(time), performance.person
    pose, markers = poses(person.body, motion.q), person.body.markers
    bone = pose.points(markers.segment, np.array(markers.position))
    acceleration = make_interp_spline(time, bone, k=5).derivative(2)(time)
    turn = pose.rotation[:, list(markers.segment)]
    # Sum over joints of angle times pull: linear in the angles.
    skin = np.einsum("tj,jki->tki", motion.q[:, 7:] - reference_angles(person), tissue.pull)
    if tissue.wave[0].any():
        size, frequency, phase = tissue.wave
        skin += size * np.sin(frequency * time[:, None, None] + phase)
    # R'(g - a): what a spring on the bone feels.
    specific = np.einsum("tkji,tkj->tki", turn, GRAVITY - acceleration)
    # Less what it felt upright when the markers were glued: gravity along -y of every segment.
    skin += tissue.sag[:, None] * (specific - np.array([0.0, GRAVITY[2], 0.0]))
    if np.any(tissue.sag):
        drift = skeleton.smooth_noise(rng, time, columns=3 * len(markers.names), cutoff=0.3)
        skin += 0.0005 * drift.reshape(skin.shape)  # m rms per axis
    xyz = (bone + np.einsum("tkij,tkj->tki", turn, skin)) @ tilt.T
    wander = skeleton.smooth_noise(rng, time, columns=3 * xyz.shape[1], cutoff=0.6).reshape(xyz.shape)
    xyz = xyz + tolerances.camera_wander * wander + tolerances.camera_noise * rng.normal(size=xyz.shape)
    if performance.plan.role != "static":
        step = time[1] - time[0]
        # Poisson: independent gaps, so many a minute in the mean.
        for _ in range(rng.poisson(tolerances.gaps_per_minute * (time[-1] - time[0]) / 60.0)):
            first, marker = int(rng.integers(0, time.size)), int(rng.integers(0, xyz.shape[1]))
            xyz[first : first + int(rng.uniform(0.05, 0.30) / step), marker] = np.nan  # s
    return Markers(markers.names, time, xyz)


HALF_SIZE = np.array([0.2, 0.3])
"""m, half sides along plate x and y."""
HALF_BELT = np.array([0.25, 0.85])
"""m, the same of one belt of an instrumented split-belt treadmill."""
ORIGIN = np.array([0.0004, -0.0006, -0.0380])
"""m, from the sensor's origin to the centre of the surface, plate axes (z down, hence negative)."""
NEWTON, _INCH = 4.4482216152605, 0.0254
CALIBRATION = (
    np.diag([NEWTON] * 3 + [NEWTON * _INCH] * 3)
    @ np.array(
        [
            [0.6521, 0.0045, -0.0002, -0.0057, -0.0019, 0.0020],
            [-0.0015, 0.6525, -0.0117, -0.0082, -0.0034, -0.0077],
            [0.0010, -0.0052, 2.5676, -0.0012, 0.0012, 0.0006],
            [-0.0168, 0.0309, -0.0594, 12.8865, -0.0469, -0.0248],
            [0.0314, 0.0101, -0.0595, 0.0163, 10.1565, -0.0069],
            [0.0327, 0.1287, -0.0279, 0.0057, 0.0677, 5.4770],
        ]
    )
    * 50.0
)
"""(6, 6) N/V, N·m/V: the sheet of a real AMTI unit (lb, lb·in per microvolt and volt), gain 2000, 10 V excitation."""
FULL_SCALE = 10.0 * np.diag(CALIBRATION)
"""(6,) N, N·m at 10 V: 1450, 1450, 5710, 728, 574, 309."""


@dataclass(frozen=True, eq=False)
class TruePlate:
    """One plate as it truly is: ``corners`` (4, 3) m as surveyed; ``turn`` (3, 3), ``centre`` (3,) m its true pose in
    the lab frame; ``mixing`` (6, 6) gains and cross-talk; ``offset`` (6,) N, N·m; ``side`` whose foot it carries,
    "both" for a single plate, "none" for an empty one.
    """

    corners: Array
    turn: Array
    centre: Array
    mixing: Array
    offset: Array
    side: str = "both"


def lay_plate(
    centre: Array,
    heading: float,
    side: str,
    tolerances: skeleton.LabTolerances,
    rng: np.random.Generator,
    *,
    moment_zero: float,
    half: Array,
) -> TruePlate:
    """Return a plate whose long side lies along ``heading`` (rad from lab x), surveyed at ``centre`` (3,) m and truly a
    little elsewhere; ``moment_zero`` N·m, standard deviation of its moments' zeros beyond that of its forces; ``half``
    (2,) m, half its sides across and along.
    """
    # Full scales say what is large in each channel: noise and zeros in proportion to that of Fz.
    t, relative = tolerances, FULL_SCALE / FULL_SCALE[2]
    forward, leftward = (
        np.array([np.cos(heading), np.sin(heading), 0.0]),
        np.array([-np.sin(heading), np.cos(heading), 0.0]),
    )
    # Columns: x to the left, y ahead, z down, which is right-handed.
    turn = np.stack([leftward, forward, np.array([0.0, 0.0, -1.0])], axis=1)
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners = centre + (signs * half) @ turn[:, :2].T
    # A share of one channel's full scale shows as the same share of another one's.
    mixing = t.plate_crosstalk * rng.normal(size=(6, 6)) * np.outer(FULL_SCALE, 1 / FULL_SCALE)
    np.fill_diagonal(mixing, 1.0 + t.plate_gain * rng.normal(size=6))
    true_turn = turn @ skeleton.small_rotation(t.plate_rotation * rng.normal(size=3))
    place, zero = centre + t.plate_position * rng.normal(size=3), t.plate_offset * relative * rng.normal(size=6)
    if moment_zero:
        zero[3:] += moment_zero * rng.normal(size=3)
    return TruePlate(corners, true_turn, place, mixing, zero, side)


def sense_plate(
    performance: Performance,
    plate: TruePlate,
    time: Array,
    tilt: Array,
    tolerances: skeleton.LabTolerances,
    rng: np.random.Generator,
) -> Array:
    """Return what the plate's six channels say (S, 6) N, N·m at ``time`` (S,) s: reaction on the subject, plate axes,
    about the plate's origin.

    ``tilt`` (3, 3) turns true-vertical axes into the laboratory's.
    """
    # What is stored at t happened earlier.
    late = time - tolerances.plate_delay
    if plate.side == "none":
        value = np.zeros((time.size, 6))
    else:  # about the lab origin, under one foot or both
        both = plate.side == "both"
        value = performance.wrench(late).value if both else performance.foot_wrench(late, plate.side)
    force, moment = value[:, :3] @ tilt.T, value[:, 3:] @ tilt.T
    # M_c = M - c x F, then both into plate axes: v @ R is R'v.
    at_centre = moment - np.cross(plate.centre, force)
    force, moment = force @ plate.turn, at_centre @ plate.turn
    # M_o = M_c + r x F, r from the sensor's origin to the centre.
    true = np.concatenate([force, moment + np.cross(ORIGIN, force)], axis=1)
    noise = tolerances.plate_noise * FULL_SCALE / FULL_SCALE[2] * rng.normal(size=true.shape)
    return true @ plate.mixing.T + plate.offset + noise


def digitise(channels: Array, plate: TruePlate, *, kind: int, bits: int) -> PlateRecording:
    """Return channels (S, 6) N, N·m as the converter stores them: ``bits`` over ±10 V, ``kind`` TYPE 2 or, in volts,
    TYPE 4.
    """
    calibration = CALIBRATION if kind == 4 else np.diag(FULL_SCALE / 10.0)
    step = 20.0 / 2**bits
    # C^-1 turns loads into volts; these are rounded to steps and cut at 10 V.
    volts = np.clip(np.round(channels @ np.linalg.inv(calibration).T / step) * step, -10.0, 10.0)
    if kind == 4:
        return PlateRecording(4, plate.corners, ORIGIN, volts, calibration=calibration)
    return PlateRecording(2, plate.corners, ORIGIN, volts @ calibration.T)
