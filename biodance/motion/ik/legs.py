"""Exact legs: the six angles that hold a foot at a given pose under a given pelvis, closed form, all frames at once.

The hip is a ball (flexion z, adduction x, rotation y), the knee a hinge, the ankle two crossing hinges. The length
hip-ankle gives the knee, the direction ankle-hip in the foot's frame gives the ankle, and what rotation is left belongs
to the hip.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.errors import BiodanceError
from biodance.motion.ik.compiled.leg_closure import LegJoints, close_leg, lead, scratch
from biodance.records import Array
from biodance.spatial import axis_rotation, zxy_angles

LEG = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion", "ankle_inversion")


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg: columns of its six angles, sign of the mirrored axes, placements between its joints."""

    columns: tuple[int, ...]
    sign: float
    hip: Array
    hip_turn: Array
    thigh: Array
    knee_turn: Array
    shank: Array
    ankle_turn: Array

    @classmethod
    def of(cls, body: Body, side: str) -> "Leg":
        """Return the ``side`` ("right" or "left") leg of a true body."""
        index = tuple(body.joint_index(f"{side}_{name}") for name in LEG)
        hip, knee, ankle = (body.joints[index[k]] for k in (0, 3, 4))
        sign = -1.0 if side == "left" else 1.0
        placed = [place for joint in (hip, knee, ankle) for place in (joint.translation, joint.rotation)]
        return cls(index, sign, *placed)

    @staticmethod
    def fits(body: Body, side: str) -> bool:
        """Return whether the ``side`` leg has the joints of this closed form: names, order, axes, centres."""
        names, s = [joint.name for joint in body.joints], -1.0 if side == "left" else 1.0
        index = [names.index(name) if (name := f"{side}_{movement}") in names else -2 for movement in LEG]
        if min(index) < 0 or any(body.joints[j].parent != p for j, p in zip(index, [-1, *index[:-1]], strict=True)):
            return False
        axes = np.array([body.joints[j].axis for j in index])
        inner = [body.joints[index[k]] for k in (1, 2, 5)]
        meet = all(np.array_equal(joint.rotation, np.eye(3)) and not joint.translation.any() for joint in inner)
        wanted = np.array([[0, 0, 1], [s, 0, 0], [0, s, 0], [0, 0, -1], [0, 0, 1], [s, 0, 0]])
        return meet and bool(np.array_equal(axes, wanted))

    def _length_terms(self) -> tuple[float, float, float]:
        """Return a, b, c with (hip-ankle distance)² = a + b cos(knee) + c sin(knee)."""
        # |thigh + K R shank|², K'thigh = (x, y, z), shank = (u, v, w), R a turn by the knee about -z.
        x, y, z = self.knee_turn.T @ self.thigh
        u, v, w = self.shank
        constant = self.thigh @ self.thigh + self.shank @ self.shank + 2 * w * z
        return float(constant), float(2 * (u * x + v * y)), float(2 * (v * x - u * y))

    def length(self, knee: Array | float) -> Array:
        """Return the hip-ankle distance (T,) m at knee flexions (T,) rad."""
        a, b, c = self._length_terms()
        return np.sqrt(a + b * np.cos(knee) + c * np.sin(knee))

    def _knee(self, length: Array) -> Array:
        a, b, c = self._length_terms()
        # cos(knee - atan2(c, b)) = (length² - a) / hypot(b, c).
        reach = np.clip((length**2 - a) / np.hypot(b, c), -1.0, 1.0)
        return np.arctan2(c, b) + np.arccos(reach)

    def solve(self, pelvis_turn: Array, pelvis: Array, foot_turn: Array, ankle: Array) -> Array:
        """Return the six angles (T, 6) rad in the order of ``LEG``.

        ``pelvis_turn`` (T, 3, 3), ``pelvis`` (T, 3) m: pose of the pelvis; ``foot_turn`` (T, 3, 3), ``ankle`` (T, 3) m:
        pose of the foot; lab frame. A foot out of reach is drawn towards the hip, smoothly, along the line from the
        ankle.
        """
        hip = pelvis + pelvis_turn @ self.hip
        away = hip - ankle
        distance = np.linalg.norm(away, axis=1)
        length = soft_limit(distance, float(self.length(np.radians(0.3))), 0.002)
        knee = self._knee(length)
        # Foot's axes: the way from ankle to hip.
        local = np.einsum("tji,tj->ti", foot_turn, away * (length / distance)[:, None])
        bend = axis_rotation(np.array([0.0, 0.0, -1.0]), knee)
        # From ankle to hip with ankle angles zero, from shank and bent thigh.
        leg = -(self.shank + np.einsum("tji,j->ti", bend, self.knee_turn.T @ self.thigh))
        leg = leg @ self.ankle_turn
        # The inversion about x is fixed by the component that the dorsiflexion about z leaves alone.
        # y sin i + z cos i = hypot(y, z) sin(i + atan2(z, y)), with (y, z) of the way from the ankle.
        across = np.hypot(local[:, 1], local[:, 2])
        inversion = np.arcsin(np.clip(leg[:, 2] / across, -1.0, 1.0)) - np.arctan2(local[:, 2], local[:, 1])
        cosine, sine = np.cos(inversion), np.sin(inversion)
        y = cosine * local[:, 1] - sine * local[:, 2]
        # Angle between the two directions in the plane of the dorsiflexion.
        dorsiflexion = np.arctan2(leg[:, 1], leg[:, 0]) - np.arctan2(y, local[:, 0])
        dorsiflexion = (dorsiflexion + np.pi) % (2 * np.pi) - np.pi
        below = self.knee_turn @ bend @ self.ankle_turn
        below = (
            below
            @ axis_rotation(np.array([0.0, 0.0, 1.0]), dorsiflexion)
            @ axis_rotation(np.array([1.0, 0.0, 0.0]), inversion)
        )
        # What rotation remains between pelvis and foot belongs to the hip.
        hip_turn = np.swapaxes(pelvis_turn @ self.hip_turn, 1, 2) @ foot_turn @ np.swapaxes(below, 1, 2)
        flexion, adduction, rotation = zxy_angles(hip_turn)
        s = self.sign
        return np.stack([flexion, s * adduction, s * rotation, knee, dorsiflexion, s * inversion], axis=1)


def soft_limit(value: Array, limit: Array | float, width: float) -> Array:
    """Return ``value`` as it is below ``limit - width``, smoothly (three derivatives) nearing ``limit`` above."""
    over = np.maximum(value - (limit - width), 0.0) / width
    return np.where(over > 0, limit - width + width * (over / (1 + over**4) ** 0.25), value)


KNEE = 3
"""Place of the knee among the six joints."""
_SQUAT = np.radians(60.0)  # Flexion of the knee in the posture from which all others are found
_LOCKED = np.radians(0.3)  # Flexion of the longest leg
_SOFT = 0.0025
"""Share of the leg's length within which a foot out of reach is drawn towards the hip, smoothly."""
_BENDS = 0.1  # How much a knee must change the square of the leg's length, in that square
_POSTURES = 16  # Postures of hip and ankle in which the length of the leg is judged


@dataclass(frozen=True, eq=False)
class GeneralLeg:
    """One leg: ``columns`` of its six joints in the body; their ``joints``; ``hip`` (3,) m the point nearest to its
    first three axes, in the root's frame; ``straight`` rad the knee's angle where the leg is longest and ``sense`` +-1
    in which it bends; ``length_terms`` (3, K) m² a, b, c with (hip-ankle distance)² = a + b cos(knee) + c sin(knee) in
    K postures; ``squat`` (6,) rad.
    """

    columns: tuple[int, ...]
    joints: LegJoints
    hip: Array
    straight: float
    sense: float
    length_terms: Array
    squat: Array

    @classmethod
    def of(cls, body: Body, side: str) -> "GeneralLeg":
        """Return the leg that carries the ``side`` foot of a body in standing frames (`standing_frames`).

        Raises
        ------
        BiodanceError
            The leg has not six joints, or it cannot squat; the message says which leg and what is legal.
        """
        columns = _path(body, side)
        rotation, translation, axis = (
            np.array([getattr(body.joints[j], name) for j in columns]) for name in ("rotation", "translation", "axis")
        )
        hip = _meeting(rotation[:3], translation[:3], axis[:3])
        low, high = (np.array([limit[j] for j in columns]) for limit in (body.limits.lower, body.limits.upper))
        terms = _length_terms(rotation, translation, axis, hip, low, high)
        # Largest value of a + b cos + c sin is at atan2(c, b): the straight leg.
        straight = float(np.arctan2(terms[2, 0], terms[1, 0]))
        sense = 1.0 if high[KNEE] + low[KNEE] > 2 * straight else -1.0
        # a + hypot(b, c): the squared length there.
        longest = float(np.sqrt(terms[0, 0] + np.hypot(terms[1, 0], terms[2, 0])))
        joints = LegJoints(rotation, translation, axis, hip, longest)
        leg = cls(columns, joints, hip, straight, sense, terms, np.zeros(6))
        bent = np.where(np.arange(6) == KNEE, straight + sense * _SQUAT, 0.0)
        squat, away = np.empty(6), np.inf
        if np.hypot(terms[1, 0], terms[2, 0]) > _BENDS * longest**2:
            under = hip - np.array([0.0, float(leg.length(_SQUAT)), 0.0])
            away = float(lead(joints, bent, squat, np.eye(3), under, scratch()))
        if not away < 1e-9:
            raise BiodanceError(
                f"{body.name}: the {side} leg does not squat: its fourth joint, {body.joints[columns[KNEE]].name}, "
                f"must be the knee, with "
                "three joints of the hip above it and two of the ankle below it. No dance can be designed for other "
                "legs."
            )
        return cls(columns, joints, hip, straight, sense, terms, squat)

    def length(self, knee: Array | float) -> Array:
        """Return the least hip-ankle distance (...) m at knee flexions (...) rad from the straight leg."""
        a, b, c = self.length_terms
        angle = self.straight + self.sense * np.asarray(knee)[..., None]
        return np.asarray(np.sqrt(np.min(a + b * np.cos(angle) + c * np.sin(angle), axis=-1)))

    def solve(self, pelvis_turn: Array, pelvis: Array, foot_turn: Array, ankle: Array) -> Array:
        """Return the six angles (T, 6) rad in the order of the joints.

        ``pelvis_turn`` (T, 3, 3), ``pelvis`` (T, 3) m: pose of the pelvis; ``foot_turn`` (T, 3, 3), ``ankle`` (T, 3) m:
        pose of the foot; lab frame. A foot out of reach is drawn towards the hip, smoothly, along the line from the
        ankle.
        """
        back = np.swapaxes(pelvis_turn, 1, 2)
        away = (back @ (ankle - pelvis)[:, :, None])[..., 0] - self.hip
        distance = np.linalg.norm(away, axis=1)
        longest = float(self.length(_LOCKED))
        length = soft_limit(distance, longest, _SOFT * longest)
        place = self.hip + away * (length / distance)[:, None]
        out = np.empty((len(place), 6))
        close_leg(
            self.joints, self.squat, np.ascontiguousarray(back @ foot_turn), place, scratch(), out, np.empty(len(place))
        )
        return out


def _path(body: Body, side: str) -> tuple[int, ...]:
    """Return the six joints from the root to the ``side`` foot; BiodanceError where there are more or fewer."""
    path = body.path_to(body.feet[side].segment)
    if len(path) != 6:
        names = ", ".join(body.joints[j].name for j in path) or "none"
        raise BiodanceError(
            f"{body.name}: the {side} leg has {len(path)} joints between the root and "
            f"{body.segments[body.feet[side].segment]} ({names}); "
            "a foot that stands still needs exactly six. Choose the root and the feet so that each leg has six joints."
        )
    return path


def _meeting(rotation: Array, translation: Array, axis: Array) -> Array:
    """Return the point (3,) nearest to the axes of joints in a row, at zero angles."""
    turn, place = np.eye(3), np.zeros(3)
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for R, p, a in zip(rotation, translation, axis, strict=True):
        place, turn = place + turn @ p, turn @ R
        # Least squares of the distances to all axes: (1 - a a') (x - p) = 0 of each.
        across = np.eye(3) - np.outer(turn @ a, turn @ a)
        normal, right = normal + across, right + across @ place
    return np.asarray(np.linalg.lstsq(normal, right, rcond=None)[0])


def _length_terms(rotation: Array, translation: Array, axis: Array, hip: Array, low: Array, high: Array) -> Array:
    """Return a, b, c (3, K) of the squared hip-ankle distance, in the middle and in K - 1 postures."""
    angles = np.random.default_rng(0).uniform(low, high, (_POSTURES, 6))
    angles[0] = (low + high) / 2
    squares = []
    for knee in (0.0, np.pi / 2, np.pi):
        angles[:, KNEE] = knee
        turn, place = np.tile(np.eye(3), (_POSTURES, 1, 1)), np.zeros((_POSTURES, 3))
        for k in range(6):
            place = place + turn @ translation[k]
            turn = turn @ rotation[k] @ axis_rotation(axis[k], angles[:, k])
        squares.append(np.sum((place - hip) ** 2, axis=1))
    at_zero, at_right, at_half = squares
    a = (at_zero + at_half) / 2
    # f(0) = a + b, f(pi) = a - b, f(pi / 2) = a + c.
    return np.stack([a, at_zero - a, at_right - a])
