"""The body as a chain of one-degree-of-freedom joints, root included: the coordinates in which a dance is designed.

Coordinates x (29): root position forward, left, up (m, lab frame), root turn about its own up axis, drop about forward,
tilt about right (rad; all zero in the upright posture that faces lab x), then the joints of the body. Linear spaces of
splines suit them, and pinocchio's analytic derivatives hold for every coordinate alike.
"""

from dataclasses import dataclass
from functools import cached_property
from threading import local
from typing import Any

import numpy as np

from biodance.body.body import Body, load_pinocchio
from biodance.body.parts import GRAVITY, UPRIGHT
from biodance.errors import BiodanceError
from biodance.motion.ik.compiled.legs import GeneralLeg, Leg
from biodance.records import SIDES, Array, Motion
from biodance.spatial import axis_rotation
from biodance.threads import Sendable

ROOT = 6
_TURNS = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""Axes of turn, drop and tilt in the root's frame (up, forward, right), in the order of rotation."""


@dataclass(frozen=True, eq=False)
class Chain(Sendable):
    """A body with a free root and two six-joint legs, in the coordinates of this module."""

    body: Body

    def __post_init__(self) -> None:
        if not self.body.n_root or set(SIDES) - set(self.body.feet):
            raise BiodanceError(
                f"{self.body.name}: a dance needs a body with a free root and two feet; this one has none."
            )

    def __getstate__(self) -> dict[str, Any]:
        """Return what goes to other processes: all but what pinocchio computes in, which is made faster than sent."""
        return {name: value for name, value in super().__getstate__().items() if name != "_own"}

    @property
    def size(self) -> int:
        """Number of coordinates, 6 + joints."""
        return ROOT + len(self.body.joints)

    @cached_property
    def legs(self) -> tuple[Leg, Leg] | tuple[GeneralLeg, GeneralLeg]:
        """Right and left leg: with closed-form angles where they are built like a person's, else closed numerically."""
        if all(Leg.fits(self.body, side) for side in SIDES):
            return Leg.of(self.body, "right"), Leg.of(self.body, "left")
        return GeneralLeg.of(self.body, "right"), GeneralLeg.of(self.body, "left")

    @cached_property
    def leg_columns(self) -> tuple[list[int], list[int]]:
        """Coordinates of the right and of the left leg, hip to ankle."""
        right, left = ([ROOT + c for c in leg.columns] for leg in self.legs)
        return right, left

    @cached_property
    def arm_columns(self) -> tuple[list[int], list[int]]:
        """Coordinates of the right and of the left arm, shoulder to elbow; none of a robot whose joints have other
        names.
        """
        names = [joint.name for joint in self.body.joints]
        arms = [tuple(f"{side}_{joint}" for joint in ("shoulder", "elbow")) for side in SIDES]
        right, left = ([ROOT + j for j, name in enumerate(names) if name.startswith(arm)] for arm in arms)
        return right, left

    @cached_property
    def upper(self) -> list[int]:
        """Coordinates of trunk and arms: every joint that is in no leg."""
        taken = {c for leg in self.leg_columns for c in leg}
        return [c for c in range(ROOT, self.size) if c not in taken]

    @cached_property
    def carriers(self) -> tuple[int, ...]:
        """(N) coordinate after which each segment turns; 5 for the root's segment."""
        return tuple(ROOT + j if j >= 0 else ROOT - 1 for j in self.body.segment_joint)

    @cached_property
    def ancestors(self) -> Array:
        """(n, n) 1 where coordinate i (column) moves link k (row), else 0; a link is moved by its own coordinate."""
        table = np.zeros((self.size, self.size))
        # Root coordinate k is moved by 0 to k; every joint by all six.
        table[:, :ROOT] = np.tril(np.ones((self.size, ROOT)))
        for joint, path in enumerate(self.body.paths):
            table[ROOT + joint, ROOT + np.array(path)] = 1.0
        return table

    @cached_property
    def model(self) -> Any:
        """The pinocchio model of the chain; joint id = coordinate + 1."""
        pin = load_pinocchio()
        model, none = pin.Model(), pin.SE3.Identity()
        model.gravity.linear = np.array(GRAVITY)
        slides = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)
        for k, slide in enumerate(slides):
            model.addJoint(k, slide(), none, f"root_slide_{k}")
        for k, axis in enumerate(_TURNS):
            place = pin.SE3(UPRIGHT.copy(), np.zeros(3)) if k == 0 else none
            model.addJoint(3 + k, pin.JointModelRevoluteUnaligned(np.array(axis)), place, f"root_turn_{k}")
        for joint in self.body.joints:
            place = pin.SE3(np.array(joint.rotation), np.array(joint.translation))
            parent = ROOT if joint.parent < 0 else ROOT + joint.parent + 1
            model.addJoint(parent, pin.JointModelRevoluteUnaligned(np.array(joint.axis)), place, joint.name)
        for name, carrier in zip(self.body.segments, self.carriers, strict=True):
            model.appendBodyToJoint(
                carrier + 1, pin.Inertia.FromDynamicParameters(np.array(self.body.sip.of(name))), none
            )
        return model

    @property
    def data(self) -> Any:
        """What pinocchio computes in, one for each thread: every call overwrites it."""
        if not hasattr(self._own, "data"):
            self._own.data = self.model.createData()
        return self._own.data

    @cached_property
    def _own(self) -> local:
        return local()

    def root_rotation(self, x: Array) -> Array:
        """Return lab_R_root (T, 3, 3) of coordinates (T, n)."""
        turn, drop, tilt = (axis_rotation(np.array(axis), x[:, 3 + k]) for k, axis in enumerate(_TURNS))
        return UPRIGHT @ turn @ drop @ tilt

    def plant(self, x: Array, planted: tuple[int, ...], ankle: Array) -> Array:
        """Return x (T, n) with the angles of the planted legs (0 right, 1 left) that hold each foot flat, facing lab x,
        at ``ankle`` (2, 3) m.
        """
        out, turn = x.copy(), self.root_rotation(x)
        flat = np.broadcast_to(UPRIGHT, turn.shape)
        for side in planted:
            out[:, self.leg_columns[side]] = self.legs[side].solve(
                turn, x[:, :3], flat, np.broadcast_to(ankle[side], (len(x), 3))
            )
        return out

    def root_heights(self, x: Array, ankle: Array, knee: Array | float, sides: tuple[int, ...] = (0, 1)) -> Array:
        """Return the heights (len(sides), T) m of the root of coordinates (T, n) at which each leg, its knee bent by
        ``knee`` (T,) rad, just reaches its ``ankle`` (T, 2, 3) or (2, 3) m.
        """
        turn, heights = self.root_rotation(x), []
        for side in sides:
            hip, at = turn @ self.legs[side].hip, ankle[..., side, :]
            across = np.sum((x[:, :2] + hip[:, :2] - at[..., :2]) ** 2, axis=1)
            # Pythagoras with the straight line from hip to ankle; at least 0.1 m, where the ankle is out of reach.
            rise = np.sqrt(np.maximum(self.legs[side].length(knee) ** 2 - across, 0.01))
            heights.append(at[..., 2] + rise - hip[:, 2])
        return np.array(heights)

    def mass_centre(self, x: Array) -> Array:
        """Return the centre of mass (T, 3) m of coordinates (T, n), lab frame."""
        centre, model, data = load_pinocchio().centerOfMass, self.model, self.data
        return np.array([centre(model, data, row) for row in x]).reshape(-1, 3)

    def positions(self, x: Array) -> Array:
        """Return the positions (T, nq) of the body, as in `Motion`, from coordinates (T, n)."""
        from scipy.spatial.transform import Rotation

        quaternion = Rotation.from_matrix(self.root_rotation(x)).as_quat()
        # q and -q are one rotation: the one with a scalar part that is not negative.
        quaternion *= np.where(quaternion[:, 3:] < 0, -1.0, 1.0)
        return np.concatenate([x[:, :3], quaternion, x[:, ROOT:]], axis=1)

    def motion(self, time: Array, x: Array, rate: Array, rate2: Array) -> Motion:
        """Return the Motion of the body from coordinates (T, n) and their first and second derivatives."""
        turn = self.root_rotation(x)
        drop, tilt = (axis_rotation(np.array(_TURNS[k]), x[:, 3 + k]) for k in (1, 2))
        spin = np.zeros((len(x), 3))
        spin2 = np.zeros((len(x), 3))
        # From frame to frame, e the axis, R the turn: w becomes R'w + e rate, dw becomes R'dw +
        # e rate2 + R'w x e rate.
        for k, onward in enumerate((drop, tilt, None)):
            axis = np.array(_TURNS[k])
            spin2 = spin2 + axis * rate2[:, 3 + k, None] + np.cross(spin, axis * rate[:, 3 + k, None])
            spin = spin + axis * rate[:, 3 + k, None]
            if onward is not None:
                spin, spin2 = (np.einsum("tji,tj->ti", onward, s) for s in (spin, spin2))
        linear = np.einsum("tji,tj->ti", turn, rate[:, :3])
        # d/dt (R'u) = R'u' - w x R'u.
        linear2 = np.einsum("tji,tj->ti", turn, rate2[:, :3]) - np.cross(spin, linear)
        v = np.concatenate([linear, spin, rate[:, ROOT:]], axis=1)
        a = np.concatenate([linear2, spin2, rate2[:, ROOT:]], axis=1)
        return Motion(time, self.positions(x), v, a, joint_names=tuple(joint.name for joint in self.body.joints))
