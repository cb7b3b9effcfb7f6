"""The six angles that hold a foot at a given pose under a given pelvis, of all frames.

Of a person in closed form (`Leg`): the hip is a ball (flexion z, adduction x, rotation y), the knee a hinge, the ankle
two crossing hinges. The length hip-ankle gives the knee, the direction ankle-hip in the foot's frame gives the ankle,
and what rotation is left belongs to the hip.

Of any leg of six joints (`GeneralLeg`) by Newton's method, compiled: each frame starts from the one before it; where
that does not converge nearby, the foot is led from a known posture of the leg to its goal in small steps, so that the
knee bends to the same side in every frame.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from biodance.body.body import Body
from biodance.errors import BiodanceError
from biodance.motion.ik.compiled import compiled
from biodance.records import Array
from biodance.spatial import axis_rotation, zxy_angles

_CLOSED = 1e-12  # Distance (leg lengths) and angle (rad) from the goal at which a foot is there
_NEAR = 0.5
"""rad: a larger change of an angle from frame to frame may lead to another solution and is not trusted."""
_LEADS = 8  # Steps in which a foot is led from the known posture
_LONGEST = 0.3  # rad: longest step of an angle in one iteration
_DAMPING = 1e-2, 1e-14
"""Damping of the normal equations per squared distance from the goal, and at the goal itself."""


class LegJoints(NamedTuple):
    """Placements of six joints from the pelvis outwards: ``rotation`` (6, 3, 3), ``translation`` (6, 3) m, ``axis`` (6,
    3); ``hip`` (3,) m about which the foot is led; ``size`` m, the length of the leg.
    """

    rotation: Array
    translation: Array
    axis: Array
    hip: Array
    size: float


class _Scratch(NamedTuple):
    """Room for one leg: ``turn`` (3, 3), ``place`` (3,) of the foot, ``origin``, ``direction`` (6, 3) of the axes;
    ``goal`` (3, 3), ``spot`` (3,) on the way; ``first`` (3, 3), ``begin`` (3,) of the known posture; ``a``, ``b`` (3,
    3), ``w`` (3,); ``jacobian``, ``normal`` (6, 6), ``gap``, ``step`` (6,).
    """

    turn: Array
    place: Array
    origin: Array
    direction: Array
    goal: Array
    spot: Array
    first: Array
    begin: Array
    a: Array
    b: Array
    w: Array
    jacobian: Array
    normal: Array
    gap: Array
    step: Array


def scratch() -> _Scratch:
    """Return room for one leg, filled with zeros."""
    turn, place, axes = (3, 3), (3,), (6, 3)
    foot, way, known, products = (turn, place, axes, axes), (turn, place), (turn, place), (turn, turn, place)
    newton = ((6, 6), (6, 6), (6,), (6,))
    return _Scratch(*(np.zeros(shape) for shape in (*foot, *way, *known, *products, *newton)))


@compiled
def _multiply(a, b, out):
    """Fill ``out`` (3, 3) with a b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@compiled
def _rotation_about(x, y, z, angle, out):
    """Fill ``out`` (3, 3) with the rotation about the unit axis x, y, z by ``angle``."""
    s, c = np.sin(angle), np.cos(angle)
    r = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + r * x * x, r * x * y - s * z, r * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = r * x * y + s * z, c + r * y * y, r * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = r * x * z - s * y, r * y * z + s * x, c + r * z * z


@compiled
def _rotation_vector(a, b, out):
    """Fill ``out`` (3,) with the rotation vector of a b' (both (3, 3)), which turn by less than half a turn apart."""
    trace = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        # (R - R')/2 as a vector is sin(angle) times the axis; the elements of R = a b' that it needs.
        plus = a[j, 0] * b[i, 0] + a[j, 1] * b[i, 1] + a[j, 2] * b[i, 2]
        minus = a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]
        out[k] = 0.5 * (plus - minus)
        trace += a[k, 0] * b[k, 0] + a[k, 1] * b[k, 1] + a[k, 2] * b[k, 2]
    sine = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    # angle / sine; at zero angle both are alike.
    longer = np.arctan2(sine, 0.5 * (trace - 1.0)) / sine if sine > 1e-9 else 1.0
    for k in range(3):
        out[k] *= longer


@compiled
def _place_foot(leg, angles, s):
    """Fill turn and place of the foot, origins and directions of the axes."""
    for i in range(3):
        s.place[i] = 0.0
        for j in range(3):
            s.turn[i, j] = 1.0 if i == j else 0.0
    for k in range(6):
        p, e = leg.translation[k], leg.axis[k]
        # Parent's turn times the joint's own placement, before its angle turns about the axis.
        _multiply(s.turn, leg.rotation[k], s.a)
        for i in range(3):
            s.place[i] += s.turn[i, 0] * p[0] + s.turn[i, 1] * p[1] + s.turn[i, 2] * p[2]
            s.origin[k, i] = s.place[i]
            s.direction[k, i] = s.a[i, 0] * e[0] + s.a[i, 1] * e[1] + s.a[i, 2] * e[2]
        _rotation_about(e[0], e[1], e[2], angles[k], s.b)
        _multiply(s.a, s.b, s.turn)


@compiled
def _solve_step(s, damping):
    """Fill the step: (J'J + damping) step = J' gap, by Cholesky's factor in ``normal``."""
    # Row by row of L L' = J'J + damping; the forward substitution of the right side goes along.
    for i in range(6):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(6):
                total += s.jacobian[k, i] * s.jacobian[k, j]
            for k in range(j):
                total -= s.normal[i, k] * s.normal[j, k]
            s.normal[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / s.normal[j, j]
        right = 0.0
        for k in range(6):
            right += s.jacobian[k, i] * s.gap[k]
        for k in range(i):
            right -= s.normal[i, k] * s.step[k]
        s.step[i] = right / s.normal[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            s.step[i] -= s.normal[k, i] * s.step[k]
        s.step[i] /= s.normal[i, i]


@compiled
def _reach_for(leg, angles, turn, place, rounds, s):
    """Improve ``angles`` (6,) until the foot has the pose ``turn``, ``place``; return how far it is from it."""
    away = np.inf
    for _ in range(rounds):
        _place_foot(leg, angles, s)
        _rotation_vector(turn, s.turn, s.w)
        square = 0.0
        for i in range(3):
            # Distances in leg lengths beside angles in rad: one measure for both.
            s.gap[i], s.gap[3 + i] = (place[i] - s.place[i]) / leg.size, s.w[i]
            square += s.gap[i] * s.gap[i] + s.w[i] * s.w[i]
        away = np.sqrt(square)
        if away < _CLOSED:
            break
        for k in range(6):
            for i in range(3):
                m, n = (i + 1) % 3, (i + 2) % 3
                # a x (foot - origin): how the foot moves with the angle.
                lever = s.direction[k, m] * (s.place[n] - s.origin[k, n]) - s.direction[k, n] * (
                    s.place[m] - s.origin[k, m]
                )
                s.jacobian[i, k], s.jacobian[3 + i, k] = lever / leg.size, s.direction[k, i]
        # Levenberg's damping in proportion to the squared distance: strong far away, and quadratic convergence near.
        _solve_step(s, _DAMPING[0] * square + _DAMPING[1])
        longest = _LONGEST
        for k in range(6):
            longest = max(longest, abs(s.step[k]))
        for k in range(6):
            angles[k] += s.step[k] * (_LONGEST / longest)
    return away


@compiled
def lead(leg, known, angles, turn, place, s):
    """Fill ``angles`` (6,) for the pose ``turn``, ``place``, led from ``known``; return the foot's distance."""
    for k in range(6):
        angles[k] = known[k]
    _place_foot(leg, angles, s)
    _rotation_vector(turn, s.turn, s.w)
    size = np.sqrt(s.w[0] * s.w[0] + s.w[1] * s.w[1] + s.w[2] * s.w[2])
    x, y, z = (s.w[0] / size, s.w[1] / size, s.w[2] / size) if size > 1e-12 else (1.0, 0.0, 0.0)
    short, long = 0.0, 0.0
    for i in range(3):
        s.begin[i] = s.place[i] - leg.hip[i]
        short, long = short + s.begin[i] ** 2, long + (place[i] - leg.hip[i]) ** 2
        for j in range(3):
            s.first[i, j] = s.turn[i, j]
    # Turn about a fixed axis and distance to the hip in even shares; direction along the chord.
    for k in range(1, _LEADS):
        share, length = k / _LEADS, 0.0
        _rotation_about(x, y, z, share * size, s.b)
        _multiply(s.b, s.first, s.goal)
        for i in range(3):
            s.spot[i] = (1.0 - share) * s.begin[i] + share * (place[i] - leg.hip[i])
            length += s.spot[i] ** 2
        # The chord is shorter than its ends: stretched so that the leg never has to shorten on the way.
        longer = ((1.0 - share) * np.sqrt(short) + share * np.sqrt(long)) / np.sqrt(length)
        for i in range(3):
            s.spot[i] = leg.hip[i] + longer * s.spot[i]
        _reach_for(leg, angles, s.goal, s.spot, 6, s)
    return _reach_for(leg, angles, turn, place, 60, s)


@compiled
def close_leg(leg, known, turn, place, s, out, away):
    """Fill ``out`` (T, 6) with the angles for foot poses ``turn``, ``place``, ``away`` (T,) how far it stays."""
    for t in range(len(place)):
        change = np.inf
        # Only a closed neighbour is a start.
        if t and away[t - 1] < _CLOSED:
            for k in range(6):
                out[t, k] = out[t - 1, k]
            away[t] = _reach_for(leg, out[t], turn[t], place[t], 10, s)
            change = 0.0
            for k in range(6):
                change = max(change, abs(out[t, k] - out[t - 1, k]))
        if not (away[t] < _CLOSED and change < _NEAR):
            away[t] = lead(leg, known, out[t], turn[t], place[t], s)


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
        a, b, c = self._length_terms()
        # cos(knee - atan2(c, b)) = (length² - a) / hypot(b, c).
        knee = np.arctan2(c, b) + np.arccos(np.clip((length**2 - a) / np.hypot(b, c), -1.0, 1.0))
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
