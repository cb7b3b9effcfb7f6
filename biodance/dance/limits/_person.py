"""Limits that come with a person (`problem.person`), no members of the family: no arm is lifted farther than it may, by
whatever joint angles, and no foot bears more.
"""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import NOTHING, CheckedMotion, Limit, Margins, Remaining, bounded, unconcerned
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.state import State
from biodance.motion.dynamics import distribute
from biodance.records import SIDES, Array
from biodance.spatial import axis_rotation

LEAST_LIFT, _FREE = 5.0, 180.0
"""degrees that are legal: nobody keeps an arm closer to the trunk on purpose, and no farther away."""
_KEPT = 0.03  # rad that known postures keep from it
_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True)
class ArmLift(Limit):
    """Degrees by which the ``right`` and the ``left`` upper arm are lifted at most, ``forward`` (and backward) and
    ``sideways``; ``hand`` degrees to which the palm, seen from its shoulder, is lifted at most (90: shoulder height).

    The lift is the angle θ between the upper arm's axis and the trunk's down axis, in the plane φ between sideways (0)
    and forward or backward (90 degrees): elevation and plane of elevation of the thoracohumeral joint (Wu et al. 2005,
    ISB). From straight sideways to straight forward the greatest lift goes along an ellipse,
    1 / greatest(φ)² = (cos φ / sideways)² + (sin φ / forward)².
    """

    right_forward: float = bounded(_FREE, LEAST_LIFT, _FREE, "degrees")
    right_sideways: float = bounded(_FREE, LEAST_LIFT, _FREE, "degrees")
    left_forward: float = bounded(_FREE, LEAST_LIFT, _FREE, "degrees")
    left_sideways: float = bounded(_FREE, LEAST_LIFT, _FREE, "degrees")
    hand: float = bounded(_FREE, LEAST_LIFT, _FREE, "degrees")
    name, unit, scale, suspicion = "arm_lift", "rad", 0.3, 20

    def reach(self, side: str) -> float:
        """Return degrees by which an arm is lifted at most in the direction in which that is least."""
        return float(min(getattr(self, f"{side}_{way}") for way in ("forward", "sideways")))

    def _greatest(self) -> Array:
        """Return (K, 2) rad forward and sideways of right and left upper arm, then of both palms if limited."""
        arms = [[getattr(self, f"{side}_{way}") for way in ("forward", "sideways")] for side in SIDES]
        return np.radians(arms + ([[self.hand] * 2] * 2 if self.hand < _FREE else []))

    def margins(self, state: State) -> Margins:
        """Return how much farther each arm (and palm) may be lifted, (T, K) rad: θ at the ellipse less θ, in the scale
        of the smaller half axis.
        """
        body, greatest = state.chain.body, self._greatest()
        if not {f"{side}_upper_arm" for side in SIDES} <= set(body.segments):
            return unconcerned(state)
        trunk, arms = body.segment_index("trunk_head"), [body.segment_index(f"{side}_upper_arm") for side in SIDES]
        ends = [(arm, -_Y) for arm in arms] + [palm(body, side) for side in SIDES]
        tips, tip_slopes = state.points([segment for segment, _ in ends], np.array([place for _, place in ends]))
        roots, root_slopes = state.points(arms * 2, np.zeros((4, 3)))
        # Tips of the trunk's unit axes less its origin: its rotation, and its slopes, from points alone.
        axes, axis_slopes = state.points([trunk] * 4, np.concatenate([[np.zeros(3)], np.eye(3)]))
        turn, turns = axes[:, 1:] - axes[:, :1], axis_slopes[:, 1:] - axis_slopes[:, :1]
        arm, by = tips - roots, tip_slopes - root_slopes
        seen = np.einsum("tac,tkc->tka", turn, arm)  # in the trunk's frame: ahead, up, right
        # Product rule: both the trunk and the arm move.
        slope = np.einsum("tac,tkcn->tkan", turn, by) + np.einsum("tacn,tkc->tkan", turns, arm)
        value, change = _left(seen[:, : len(greatest)], greatest)
        return Margins(value, np.einsum("tka,tkan->tkn", change, slope[:, : len(greatest)])[None])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return what `margins` does, by the rotations of trunk and upper arms and spherical angles."""
        body, pose, greatest = motion.body, motion.pose, self._greatest()
        if not {f"{side}_upper_arm" for side in SIDES} <= set(body.segments):
            return NOTHING
        trunk, found = pose.rotation[:, body.segment_index("trunk_head")], []
        arms = [body.segment_index(f"{side}_upper_arm") for side in SIDES]
        for k, (forward, sideways) in enumerate(greatest):
            arm = arms[k % 2]
            if k < 2:
                away = -pose.rotation[:, arm, :, 1]
            else:
                hand, place = palm(body, SIDES[k % 2])
                away = pose.points([hand], place[None])[:, 0] - pose.position[:, arm]
            # R'v: ahead, up, right in the trunk's frame.
            x, y, z = np.moveaxis(np.einsum("tca,tc->ta", trunk, away), 1, 0)
            lift, plane = np.arccos(np.clip(-y / np.sqrt(x**2 + y**2 + z**2), -1.0, 1.0)), np.arctan2(x, z)
            # Polar form of the ellipse.
            most = 1 / np.hypot(np.sin(plane) / forward, np.cos(plane) / sideways)
            found.append(min(forward, sideways) * (1 - lift / most))
        of = [f"{side}_{what}" for what in ("upper_arm", "hand") for side in SIDES]
        return Remaining(np.stack(found, axis=1), tuple(of[: len(found)]))

    def eased(self, angles: dict[str, float]) -> dict[str, float]:
        """Return the angles with arms that are lifted no farther than they may be, in the same plane; the elbow of an
        arm whose palm would come too high is stretched.
        """
        out = dict(angles)
        for k, side in enumerate(SIDES):
            flexion, adduction, rotation, elbow = (
                f"{side}_{joint}"
                for joint in ("shoulder_flexion", "shoulder_adduction", "shoulder_rotation", "elbow_flexion")
            )
            if flexion not in angles:
                continue
            # R_z(f) R_x(a) (-e_y) = (sin f cos a, -cos f cos a, -sin a), solved for f and a below.
            arm = _turn(_Z, angles[flexion]) @ _turn(_X, angles[adduction])
            x, y, z = arm @ -_Y
            forward, sideways = self._greatest()[k]
            # Unit vector in the horizontal plane, or nothing for an arm that hangs.
            ahead, aside = np.array([x, z]) / max(float(np.hypot(x, z)), 1e-9)
            lift = min(float(np.arctan2(np.hypot(x, z), -y)), 1 / np.hypot(ahead / forward, aside / sideways) - _KEPT)
            out[flexion] = float(np.arctan2(np.sin(lift) * ahead, np.cos(lift)))
            out[adduction] = -float(np.arcsin(np.sin(lift) * aside))
            turned = _turn(_Y, angles[rotation]) @ _turn(_Z, angles[elbow])
            up = (arm @ (turned @ -_Y - _Y))[1]  # of a forearm as long as the upper arm
            if self.hand < _FREE and up > -0.1:
                out[elbow] = min(angles[elbow], 0.2)
        return out


def _turn(axis: Array, angle: float) -> Array:
    return np.asarray(axis_rotation(axis, np.array([angle]))[0])


def _left(seen: Array, greatest: Array) -> tuple[Array, Array]:
    """Return what is left (T, K) rad of the lifts of directions ``seen`` (T, K, 3) m, and its slopes by them."""
    flat = np.maximum(np.hypot(seen[..., 0], seen[..., 2]), 1e-9)
    down, square = -seen[..., 1], np.sum(seen**2, axis=-1)
    # Angle to the down axis.
    lift, least = np.arctan2(flat, down), greatest.min(axis=1)
    share = np.stack([seen[..., 0] / greatest[:, 0], seen[..., 2] / greatest[:, 1]], axis=-1)
    size = np.maximum(np.linalg.norm(share, axis=-1), 1e-12)  # of the direction times `flat`, in half axes
    # d flat = (x dx + z dz) / flat.
    by_flat = np.stack([seen[..., 0], np.zeros_like(flat), seen[..., 2]], axis=-1) / flat[..., None]
    # d atan2(flat, down) = (down d flat - flat d down) / (flat² + down²), with d down = -e_y.
    by_lift = (down[..., None] * by_flat + flat[..., None] * _Y) / square[..., None]
    by_size = (
        np.stack([share[..., 0] / greatest[:, 0], np.zeros_like(flat), share[..., 1] / greatest[:, 1]], axis=-1)
        / size[..., None]
    )
    # 1 / greatest = size / flat, so this is the lift over the greatest one.
    used = lift * size / flat
    # Product rule for lift, size and 1 / flat.
    slopes = by_lift * (size / flat)[..., None] + (lift / flat)[..., None] * by_size
    slopes -= (lift * size / flat**2)[..., None] * by_flat
    return least * (1 - used), -least[:, None] * slopes


@dataclass(frozen=True)
class FootLoad(Limit):
    """Share of the vertical ground force that the ``right`` and the ``left`` foot bear at most; 1: no limit of that
    foot, which may bear all.
    """

    right: float = bounded(1.0, 0.0, 1.0)
    left: float = bounded(1.0, 0.0, 1.0)
    name, unit, scale, suspicion = "foot_load", "N", 50.0, 15

    @property
    def _limited(self) -> list[int]:
        return [side for side, share in enumerate((self.right, self.left)) if share < 1]

    def margins(self, state: State) -> Margins:
        """Return how much more each foot with a limit may bear, (T, feet) N; none on a stool."""
        if not state.stance.planted or not self._limited:
            return unconcerned(state)
        feet, share, (force, by) = self._limited, np.array([self.right, self.left]), state.feet
        value = share * state.wrench[:, 2:3] - force[:, :, 2]
        # Chain rule: foot by total, total by motion.
        slopes = share[:, None] * state.wrench_slopes[:, :, 2:3] - by[None, :, :, 2] @ state.wrench_slopes
        return Margins(value[:, feet], slopes[:, :, feet])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return how much more each foot with a limit may bear, (T, feet) N, from where the soles really are; nothing
        on a stool.
        """
        if not motion.stance.planted or not self._limited:
            return NOTHING
        right, left = (sole.mean(axis=1) for sole in motion.soles)
        touching = np.tile([side in motion.stance.planted for side in (0, 1)], (motion.motion.time.size, 1))
        borne = [part.force[:, 2] for part in distribute(motion.wrench, right, left, touching)]
        value = np.array([self.right, self.left]) * motion.wrench.force[:, 2:] - np.stack(borne, axis=1)
        return Remaining(value[:, self._limited], tuple(f"{SIDES[side]}_foot" for side in self._limited))
