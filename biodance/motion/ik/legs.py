"""Exact legs: the six angles that hold a foot at a given pose under a given pelvis, closed form, all frames at once.

The hip is a ball (flexion z, adduction x, rotation y), the knee a hinge, the ankle two crossing hinges. The length
hip-ankle gives the knee, the direction ankle-hip in the foot's frame gives the ankle, and what rotation is left belongs
to the hip.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.records import Array
from biodance.spatial import axis_rotation, zxy_angles

LEG = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion", "ankle_inversion")


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg of a body: columns of its six angles, sign of the mirrored axes, and the constant placements between
    its joints.
    """

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
        return cls(
            index,
            sign,
            hip.translation,
            hip.rotation,
            knee.translation,
            knee.rotation,
            ankle.translation,
            ankle.rotation,
        )

    @staticmethod
    def fits(body: Body, side: str) -> bool:
        """Return whether the ``side`` leg of a body has the joints of this closed form: names, order, axes, meeting
        in hip and ankle.
        """
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
        local = np.einsum("tji,tj->ti", foot_turn, away * (length / distance)[:, None])
        bend = axis_rotation(np.array([0.0, 0.0, -1.0]), knee)
        leg = -(self.shank + np.einsum("tji,j->ti", bend, self.knee_turn.T @ self.thigh))
        leg = leg @ self.ankle_turn
        inversion = _solve_sine(local[:, 1], local[:, 2], leg[:, 2])
        cosine, sine = np.cos(inversion), np.sin(inversion)
        y = cosine * local[:, 1] - sine * local[:, 2]
        dorsiflexion = np.arctan2(leg[:, 1], leg[:, 0]) - np.arctan2(y, local[:, 0])
        dorsiflexion = (dorsiflexion + np.pi) % (2 * np.pi) - np.pi
        below = self.knee_turn @ bend @ self.ankle_turn
        below = (
            below
            @ axis_rotation(np.array([0.0, 0.0, 1.0]), dorsiflexion)
            @ axis_rotation(np.array([1.0, 0.0, 0.0]), inversion)
        )
        hip_turn = np.swapaxes(pelvis_turn @ self.hip_turn, 1, 2) @ foot_turn @ np.swapaxes(below, 1, 2)
        flexion, adduction, rotation = zxy_angles(hip_turn)
        s = self.sign
        return np.stack([flexion, s * adduction, s * rotation, knee, dorsiflexion, s * inversion], axis=1)


def soft_limit(value: Array, limit: Array | float, width: float) -> Array:
    """Return ``value`` unchanged below ``limit - width`` and smoothly (three derivatives) approaching ``limit``
    above.
    """
    over = np.maximum(value - (limit - width), 0.0) / width
    return np.where(over > 0, limit - width + width * (over / (1 + over**4) ** 0.25), value)


def _solve_sine(y: Array, z: Array, wanted: Array) -> Array:
    """Return the small angle i with ``y sin i + z cos i = wanted``."""
    return np.arcsin(np.clip(wanted / np.hypot(y, z), -1.0, 1.0)) - np.arctan2(z, y)
