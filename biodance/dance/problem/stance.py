"""Where the feet stand and which part of the ground may carry the weight."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Index, assign, freeze
from biodance.threads import Sendable

_WIDTH = 0.12
"""Distance between the ankles, fraction of stature (about 1.3 times the width of the hips)."""
STRIP, _CLEAR = 0.1, 1.25
"""Of the width of a sole: how much the reduced supports of both feet and of one overlap at least; of its inner half:
room between feet.
"""
_COMMON = 0.5
"""Of the depth in the base of the foot over which the weight is, in that of both: where as much was asked of both,
imprecise people came as near as 1 mm to the edge of the foot as they lifted the other one.
"""
_FORWARD = 0.2  # m: how far the right foot stands in front (paper III.D, human subject)
SINGLE = {"single_right": (0,), "single_left": (1,)}
SEAT_TO_HIP = 0.08
"""m from a seat up to the hip centres of who sits on it: half a thigh."""
_GRIP = (0.24, 0.30, 0.53)
"""Grips of a walking frame: m ahead of the ankles, m to the side, height over stature (hands of half-bent arms)."""


@dataclass(frozen=True, eq=False)
class Stance(Sendable):
    """One foot configuration.

    ``name``; ``ankle`` (2, 3) m lab frame, right and left, where each foot stands or would stand, flat and facing lab
    x; ``planted`` the feet on the ground (0 right, 1 left); ``soles`` (2, P, 3) m their outlines; ``share`` of every
    half width of the support for which the stance is laid out (`Limit.support_share`); ``props`` (K, 2) m corners on
    the ground of what else bears weight: the legs of a stool; ``hands`` (2, 3) m grips that the right and the left hand
    hold, NaN = free; ``seat`` m height of the hip centres of a person on a stool, pelvis upright and still over the lab
    origin; 0 standing; ``over`` the one of two planted feet (0, 1) over which the weight is, so that the other could be
    lifted; None anywhere; ``hanging`` the arms (0 right, 1 left) that are asked for nothing.
    """

    name: str
    ankle: Array
    planted: tuple[int, ...]
    soles: Array
    share: float = 1.0
    props: Array = field(default_factory=lambda: np.empty((0, 2)))
    seat: float = 0.0
    over: int | None = None
    hands: Array = field(default_factory=lambda: np.full((2, 3), np.nan))
    hanging: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        assign(self, planted=tuple(self.planted), hanging=tuple(self.hanging))
        assign(self, props=self.props if np.size(self.props) else np.empty((0, 2)))
        freeze(self, "Stance", ankle=(2, 3), soles=(2, None, 3), hands=(2, 3), props=(None, 2))

    @cached_property
    def support(self) -> Array:
        """(P, 2) m corners of the base of support (convex hull of planted soles and props), counter-clockwise."""
        from scipy.spatial import ConvexHull

        points = np.concatenate([*(self.soles[side][:, :2] for side in self.planted), self.props])
        return points[ConvexHull(points).vertices]

    @cached_property
    def centre(self) -> Array:
        """(2,) m middle of the base of support: of its bounding box; weight over one foot: deepest in this foot's base,
        and at least `_COMMON` times as deep in that of both.
        """
        if self.over is not None:
            from scipy.optimize import linprog

            normals, offsets = self.reduced(self.share)
            # Deepest point: maximise z subject to normals p + offsets >= depth z.
            depth = np.ones(len(normals))
            depth[: len(self.on(0, 1).reduced(self.share)[1])] = _COMMON
            rows = np.column_stack([-normals, depth])
            return np.asarray(linprog([0.0, 0.0, -1.0], rows, offsets, bounds=(None, None)).x[:2])
        return (self.support.min(axis=0) + self.support.max(axis=0)) / 2

    def reduced(self, share: float) -> tuple[Array, Array]:
        """Return unit inward normals (P, 2) and offsets (P,) m of the base of support, drawn together to ``share``
        about its middle: ``normals @ p + offsets`` is the distance inside. With the weight over one foot: of both
        feet's base and of that one's.
        """
        if share in self._reduced:
            return self._reduced[share]
        if self.over is not None:
            both, one = (self.on(*feet).reduced(share) for feet in ((0, 1), (self.over,)))
            normals, offsets = (np.concatenate(parts) for parts in zip(both, one, strict=True))
        else:
            corners = self.centre + share * (self.support - self.centre)
            along = np.roll(corners, -1, axis=0) - corners
            # Counter-clockwise, so the inside is to the left of every edge.
            normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
            offsets = -np.einsum("ij,ij->i", normals, corners)
        self._reduced[share] = normals, offsets
        return normals, offsets

    @cached_property
    def _reduced(self) -> dict[float, tuple[Array, Array]]:
        return {}

    @cached_property
    def key(self) -> str:
        """What the feet are known by: who stands on the same ones may take the same postures."""
        return f"{self.name} {self.planted} {self.over} {self.ankle.tobytes().hex()}"

    @cached_property
    def whole(self) -> "Stance":
        """The same feet, wherever above them the weight is."""
        return self if self.over is None else replace(self, over=None)

    @property
    def quiet(self) -> tuple[int, ...]:
        """The arms (0 right, 1 left) that hold a grip or hang: nobody is asked to move them."""
        return tuple(sorted({*self.holding, *self.hanging}))

    @property
    def holding(self) -> tuple[int, ...]:
        """The hands (0 right, 1 left) that hold a grip."""
        return tuple(side for side in (0, 1) if np.isfinite(self.hands[side, 0]))

    @cached_property
    def sole_centres(self) -> Array:
        """(2, 3) m middle of each sole on the ground."""
        return self.soles.mean(axis=1)

    def on(self, *planted: int) -> "Stance":
        """Return the stance with only these feet on the ground."""
        apart = "parallel" if self.ankle[0, 0] == self.ankle[1, 0] else "right_forward"
        return replace(
            self,
            planted=planted,
            over=None,
            name=apart if len(planted) == 2 else ("single_right", "single_left")[planted[0]],
        )


def stance(
    body: Body,
    name: str,
    *,
    right: float = 0.0,
    planted: tuple[int, ...] = (0, 1),
    share: float = 1.0,
    wide: float = 1.0,
) -> Stance:
    """Return a stance with the left ankle at the lab origin's line and the right one ``right`` m ahead, side by side at
    the person's width, or ``wide`` times as far apart.
    """
    height = -float(body.feet["right"].outline[:, 1].min())
    half = apart(body, share, wide=wide) / 2
    ankle = np.array([[right, -half, height], [0.0, half, -float(body.feet["left"].outline[:, 1].min())]])
    soles = [
        # Foot frame (ahead, up, right) to lab (ahead, left, up).
        ankle[k] + np.stack([o[:, 0], -o[:, 2], o[:, 1]], axis=1)
        for k, o in enumerate(body.feet[side].outline for side in SIDES)
    ]
    return Stance(name, ankle, planted, np.array(soles), share)


def holding(feet: Stance, body: Body, hands: tuple[str, ...]) -> Stance:
    """Return the stance in which the named ``hands`` ("right", "left") hold the grips of a frame around the person."""
    grips, stature = np.full((2, 3), np.nan), stature_of(body)
    for side, name in enumerate(SIDES):
        if name in hands:
            grips[side] = [_GRIP[0], (-_GRIP[1], _GRIP[1])[side], _GRIP[2] * stature]
    return replace(feet, hands=grips)


def seat(body: Body, *, share: float = 1.0, height: float = 0.0) -> Stance:
    """Return the stance of a person on a stool, hips over the lab origin, feet hanging above the ground; ``height`` m
    of its seat, 0: as low as the feet hang.
    """
    feet = stance(body, "seated", planted=(), share=share)
    legs = [np.linalg.norm(body.joints[body.joint_index(f"{side}_ankle_dorsiflexion")].translation) for side in SIDES]
    # Hanging legs have 8 cm between their soles and the ground.
    hips = height + SEAT_TO_HIP if height else float(max(legs) + feet.ankle[:, 2].max()) + 0.08
    # the legs of a stool of 0.4 m by 0.4 m, from below the hips
    return replace(feet, props=np.array([[-0.15, -0.2], [0.25, -0.2], [0.25, 0.2], [-0.15, 0.2]]), seat=hips)


def apart(body: Body, share: float, *, wide: float = 1.0) -> float:
    """Return the distance (m) between the ankles: of a person about 1.3 times the width of the hips; of a robot at
    least that of its hips.

    Never so wide that the reduced support of both feet ends before that of one begins: then the weight could not be
    shifted. Never so narrow that the feet touch.
    """
    sideways = body.feet["right"].outline[:, 2]
    outer, inner = float(sideways.max()), -float(sideways.min())
    usual = wide * max(_WIDTH * stature_of(body), hip_width(body))
    if share >= 1.0:
        return usual
    middle, wide = (outer - inner) / 2, outer + inner
    # share (h + outer) = h + middle - (share / 2 - STRIP) wide, solved for 2 h.
    widest = 2 * (share * outer - middle + (share / 2 - STRIP) * wide) / (1 - share)
    return min(usual, max(widest, _CLEAR * 2 * inner))


def hip_width(body: Body) -> float:
    """Return the distance (m) sideways between the ankles of the upright body: its hips' with straight legs."""
    place = poses(body, body.neutral[None]).position[0]
    return float(place[body.feet["left"].segment, 1] - place[body.feet["right"].segment, 1])


def stature_of(body: Body) -> float:
    """Return the height (m) of the upright body: top of its highest box over its soles."""
    pose = poses(body, body.neutral[None])
    tops = [float((pose.position[0, i] + pose.rotation[0, i] @ box[1])[2]) for i, box in enumerate(body.boxes)]
    foot = body.feet["right"]
    return max(tops) - float(pose.points([foot.segment], foot.outline[:1])[0, 0, 2])


def feet_in_move(first: Stance, second: Stance) -> Stance:
    """Return the feet on the ground during the move from one stance to the next."""
    for one in (first, second):
        if len(one.planted) < 2:
            return one
    return replace(second, over=None) if np.array_equal(first.ankle, second.ankle) else second.on(1)


FEET = {
    "parallel": "with both feet side by side",
    "right_forward": "with the right foot in front",
    "single_right": "on the right leg alone",
    "single_left": "on the left leg alone",
    "seated": "on the stool",
}
"""Names of stances (paper Table I, and a stool), and where the feet are, in words."""


def stance_words(stance: Stance) -> str:
    """Return where the feet are, in words, and on which of them the weight is where it must be over one."""
    weight = "" if stance.over is None else f", the weight on the {SIDES[stance.over]} one"
    return FEET[stance.name] + weight


def support_depth(stances: Sequence[Stance], on: Index, point: Array) -> Array:
    """Return how far (T,) m each ``point`` (T, 2) lies inside the base of all planted feet of its stance
    ``stances[on[t]]``; negative outside.
    """
    out = np.empty(len(point))
    for k in np.unique(on):
        normals, offsets = stances[k].whole.reduced(1.0)
        out[on == k] = (point[on == k] @ normals.T + offsets).min(axis=1)
    return out


_TINY = 1e-30  # Step of the complex-step derivative: exact to machine precision


def foot_forces(total: Array, stance: Stance) -> tuple[Array, Array]:
    """Return the wrenches (T, 2, 6) of the right and left foot while a dance is planned, and their derivative (T, 2, 6,
    6) by the total (T, 6) that the ground must give (paper eq. 2).

    Each foot bears a share in inverse proportion to the distance of its sole's centre from the zero-moment point, of
    the force as of the moment about the vertical through that point; both forces point the same way.
    """
    if len(stance.planted) == 1:
        chosen = np.eye(2)[stance.planted[0]]
        return total[:, None] * chosen[:, None], np.broadcast_to(
            chosen[:, None, None] * np.eye(6), (len(total), 2, 6, 6)
        )
    # Complex step: the imaginary part is the derivative; (T, in, foot, out) to (T, foot, out, in) after both swaps.
    stepped = total[:, None] + 1j * _TINY * np.eye(6)
    derivative = np.swapaxes(
        _share(stepped.reshape(-1, 6), stance.sole_centres).reshape(len(total), 6, 2, 6).imag / _TINY, 1, 2
    )
    return _share(total, stance.sole_centres), np.swapaxes(derivative, 2, 3)


def _share(total: Array, centres: Array) -> Array:
    force, moment = total[:, :3], total[:, 3:]
    point = np.stack([-moment[:, 1] / force[:, 2], moment[:, 0] / force[:, 2]], axis=1)
    # Not a norm: an absolute value would lose the imaginary part.
    reach = [np.sqrt(np.sum((point - c[:2]) ** 2, axis=1)) for c in centres]
    right = reach[1] / (reach[0] + reach[1])
    # Weighted mean of the centres: so placed, both forces together have their moment about the point.
    middle = right[:, None] * centres[0, :2] + (1 - right[:, None]) * centres[1, :2]
    twist = moment[:, 2] - point[:, 0] * force[:, 1] + point[:, 1] * force[:, 0]
    feet = []
    for part, centre in ((right, centres[0]), (1 - right, centres[1])):
        x, y = (point + centre[:2] - middle).T
        # r x F on the ground, z = 0, and the twist in the same share.
        own = np.stack([y * force[:, 2], -x * force[:, 2], x * force[:, 1] - y * force[:, 0] + twist], axis=1)
        feet.append(part[:, None] * np.concatenate([force, own], axis=1))
    return np.stack(feet, axis=1)
