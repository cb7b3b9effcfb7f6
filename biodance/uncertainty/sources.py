"""The elementary sources of error of a person who is not the model: skin, flesh, joint centres, hinges, each one by
itself in unit size.

A source displaces model markers, centres of mass or segments at unchanged coordinates; the coordinates answer through
the inverse kinematics and the wrench changes (`response`), all to first order. Every kind of source says this twice,
forward - what one unit adds to the wrench and leaves of the markers - and as the transpose - what given weights on
the wrench make of it. Identification sends the columns of its regressor back, diagnosis sends the sources forward; a
test holds the two equal.
"""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.errors import UnknownName
from biodance.lab.markers.sets import part_of
from biodance.motion.ik.compiled.tree import FOUR, add_products
from biodance.motion.kinematics import Poses, below, chains, neighbours, poses
from biodance.records import Array, Index, Motion
from biodance.spatial import cross, skew
from biodance.uncertainty.response import ErrorSource, Response, in_segments


@dataclass(frozen=True, eq=False)
class _Moved(ErrorSource):
    """Errors by which the model's markers lie elsewhere, some of them by each."""

    @abstractmethod
    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        """Yield how the model's markers move by each error or kind of errors, (F, R, P) m, and their rows among 3M."""

    def functional(self, trial: Response) -> Array:
        """Return the functionals of the coordinates that follow the markers."""
        found = [trial.of_markers(moved, rows) for moved, rows in self._moved(trial)]
        return np.concatenate(found or [np.empty((len(trial.place), 9, 0))], axis=2)

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the markers that lie elsewhere."""
        return np.asarray(in_segments(trial, trial.left(*self._moved(trial))).mean(axis=0))

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of the markers that lie elsewhere."""
        # Three coordinates of each marker make its square distance.
        return np.asarray(3 * np.mean(trial.left(*self._moved(trial)) ** 2, axis=(0, 1)))


@dataclass(frozen=True, eq=False)
class _Carried(_Moved):
    """Errors of joints that displace what hangs on them: segments, and their markers with them."""

    @abstractmethod
    def _own(self, trial: Response) -> Iterator[Array]:
        """Yield joint by joint the functionals (F, 9, P) of the segments that hang on it."""

    def functional(self, trial: Response) -> Array:
        """Return the functionals of the segments, and of the coordinates that follow their markers."""
        followed = super().functional(trial)
        return followed + np.concatenate([*self._own(trial), np.empty((len(followed), 9, 0))], axis=2)


@dataclass(frozen=True, eq=False)
class Centre(_Carried):
    """A joint centre that lies elsewhere, along the axes of its parent (m).

    All that hangs on the joint is carried by R_parent - R_child C, with C = child_R_parent of the neutral posture,
    where the static trial has calibrated it away.
    """

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Three axes of every anatomical joint."""
        return tuple(f"joint_centre {part_of(name)}" for name in self.joints)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Every anatomical joint three times."""
        return tuple(joint_of(self.body, chain) for chain in chains(self.body) for _ in range(3))

    def _own(self, trial: Response) -> Iterator[Array]:
        for (on, _), drift in self._drifts(trial):
            # All that hangs is carried by one displacement: its functionals may be summed before.
            yield trial.place[:, on].sum(axis=1) @ drift

    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for (_, rows), drift in self._drifts(trial):
            # Every marker moves by the same (3, 3): repeated for the three rows of each.
            yield np.tile(drift, (1, rows.size // 3, 1)), rows

    def _drifts(self, trial: Response) -> Iterator[tuple[tuple[Index, Index], Array]]:
        """Yield for every joint what hangs on it and (F, 3, 3) m of its drift, lab, per metre on the parent's axes."""
        for chain, hanging, neutral in self._still:
            child = self.body.joints[chain[-1]].segment
            yield hanging, _above(self.body, trial.pose, chain[0]) - trial.pose.rotation[:, child] @ neutral

    @cached_property
    def _still(self) -> tuple[tuple[tuple[int, ...], tuple[Index, Index], Array], ...]:
        """Axes of every anatomical joint, what hangs on it, and child_R_parent (3, 3) of the neutral posture."""
        rest, found = poses(self.body, self.body.neutral), []
        for chain in chains(self.body):
            child = self.body.joints[chain[-1]].segment
            # child_R_parent = R_child' R_parent.
            neutral = rest.rotation[0, child].T @ _above(self.body, rest, chain[0])[0]
            found.append((chain, _hanging(self.body, chain[0]), neutral))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class Tilt(_Carried):
    """The axis of a hinge that is tilted against the bone's own, about two directions square to it (rad)."""

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Two directions of every hinge."""
        return tuple(f"tilt {part_of(name)}" for name in self.joints)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Every hinge twice."""
        return tuple(joint_of(self.body, (joint,)) for joint, _, _ in self._hinges for _ in range(2))

    def _own(self, trial: Response) -> Iterator[Array]:
        for joint, (on, _), turn in self._turns(trial):
            # A turn r about the joint's centre displaces a CoM by r x arm = -[arm]x r, and turns its segment by r.
            arm = skew(trial.com[:, on] - trial.pose.joint_position[:, joint, None])
            yield (trial.turn[:, on] - trial.place[:, on] @ arm).sum(axis=1) @ turn

    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for joint, (_, rows), turn in self._turns(trial):
            arm = trial.markers[:, rows[::3] // 3] - trial.pose.joint_position[:, joint, None]
            yield -(skew(arm) @ turn[:, None]).reshape(len(arm), rows.size, 2), rows

    def _turns(self, trial: Response) -> Iterator[tuple[int, tuple[Index, Index], Array]]:
        """Yield for every hinge its joint, what hangs on it, and (F, 3, 2) rad of its turn, lab, per radian of tilt."""
        for joint, hanging, across in self._hinges:
            # A hinge's axis off by e turns what hangs on it by angle * e (first order in the angle).
            yield joint, hanging, trial.joints[:, joint, None, None] * (trial.pose.joint_rotation[:, joint] @ across)

    @cached_property
    def _hinges(self) -> tuple[tuple[int, tuple[Index, Index], Array], ...]:
        """Every hinge: its joint, what hangs on it, and two unit vectors (3, 2) square to its axis."""
        alone = [chain[0] for chain in chains(self.body) if len(chain) == 1]
        return tuple((j, _hanging(self.body, j), np.array(_across(self.body.joints[j].axis)).T) for j in alone)


def _hanging(body: Body, joint: int) -> tuple[Index, Index]:
    """Return the segments that hang on a joint, and the rows of their markers among 3M."""
    hangs = below(body)[joint] > 0
    markers = np.flatnonzero(hangs[list(body.markers.segment)])
    # Rows of marker k among 3M: 3k, 3k + 1, 3k + 2.
    return np.flatnonzero(hangs), (3 * markers[:, None] + np.arange(3)).ravel()


def joint_of(body: Body, chain: tuple[int, ...]) -> str:
    """Return the anatomical joint of a chain of axes: ``right_hip`` of ``right_hip_flexion``."""
    return body.joints[chain[0]].name.rsplit("_", 1)[0]


def _above(body: Body, at: Poses, joint: int) -> Array:
    """Return the turn (F, 3, 3) of the frame in which a joint lies."""
    parent = body.joints[joint].parent
    return at.root_rotation if parent < 0 else at.joint_rotation[:, parent]


def _across(axis: Array) -> list[Array]:
    """Return two unit vectors square to ``axis``."""
    # The unit vector farthest from the axis: the cross product is never near zero.
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return [first, np.cross(axis, first)]


class _WithAngles(ErrorSource):
    """Errors in proportion to the turns of the joints beside a segment: every slope times every turn."""

    @abstractmethod
    def _slopes(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        """Yield for every segment functionals (F, 9, P) per radian, and the angles that they go with."""

    def functional(self, trial: Response) -> Array:
        """Return the functionals, times the angles."""
        # Slope (F, 9, P) times angle (F, n) as (F, 9, P, n), the angles last.
        parts = [value[..., None] * trial.joints[:, None, None, near] for value, near in self._slopes(trial)]
        return np.concatenate([part.reshape(*part.shape[:2], -1) for part in parts], axis=2)

    def transpose(self, trial: Response, back: Array) -> Array:
        """Return the same sums as of any error, the angles last: there are many, and few slopes."""
        found, size = [], back.shape[2]
        work, back = np.empty((FOUR, size)), np.ascontiguousarray(back)
        for value, near in self._slopes(trial):
            sums = np.zeros((value.shape[2], near.size, size))
            add_products(np.ascontiguousarray(value), trial.joints.take(near, axis=1), back, work, sums)
            found.append(sums.reshape(-1, size))
        return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class Slide(_WithAngles):
    """Skin over bone: a pattern of a segment's markers in proportion to the angle of a joint beside it (m/rad).

    ``patterns`` per segment (m, 3, P) displacements of its m markers, segment axes: the markers of a segment as a
    whole, or each alone.
    """

    patterns: tuple[Array, ...]

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Every pattern of a segment, times every angle beside it."""
        count = zip(self.body.segments, self.patterns, _near(self.body), strict=True)
        return tuple(
            f"slide {part_of(name)}" for name, pattern, near in count for _ in range(pattern.shape[2] * near.size)
        )

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the patterns, times the angles."""
        left, cuts = self._left(trial)
        local, angles = in_segments(trial, left), trial.joints
        mean = (local.reshape(len(left), -1).T @ angles / len(left)).reshape(*local.shape[1:], angles.shape[1])
        parts = (mean[:, :, cut][..., near] for cut, (*_, near) in zip(cuts, self._parts, strict=True))
        return np.concatenate([part.reshape(*part.shape[:2], -1) for part in parts], axis=2)

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of every pattern, times the squared angles."""
        count = len(self.body.markers.names) * len(trial.place)
        left, cuts = self._left(trial)
        square = np.einsum("frp,frp->fp", left, left)
        parts = zip(cuts, self._parts, strict=True)
        # |left|² of a pattern times angle² summed over frames, over M F: mean squared distance.
        return np.concatenate(
            [(square[:, cut].T @ trial.joints[:, near] ** 2 / count).ravel() for cut, (*_, near) in parts]
        )

    def _slopes(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for s, on, rows, near in self._parts:
            if self._alone[s]:
                answer = trial.answer[:, :, rows].reshape(len(trial.answer), -1, 3)
                # Each marker alone has the axes of its segment as patterns: no (3m, 3m) displacements -R are formed.
                yield -(answer @ trial.pose.rotation[:, s]).reshape(len(answer), 9, -1), near
            else:
                yield trial.of_markers(self._moved(trial, s, on), rows), near

    @cached_property
    def _alone(self) -> tuple[bool, ...]:
        """Whether every marker of a segment slides by itself: its patterns then are the axes of the segment."""
        flat = (one.reshape(3 * len(one), -1 if one.size else 0) for one in self.patterns)
        return tuple(np.array_equal(one, np.eye(one.shape[1])) for one in flat)

    def _left(self, trial: Response) -> tuple[Array, list[slice]]:
        """Return what all patterns leave of the markers (F, 3M, K) m per radian, and where those of a segment are."""
        moves = [(self._moved(trial, s, on), rows) for s, on, rows, _ in self._parts]
        ends = np.cumsum([0, *(moved.shape[2] for moved, _ in moves)])
        return trial.left(*moves), [slice(a, b) for a, b in pairwise(ends)]

    def _moved(self, trial: Response, s: int, on: Index) -> Array:
        """Return the displacements (F, 3m, P) of the model's markers against those measured, lab."""
        local = np.swapaxes(self.patterns[s], 1, 2)[None]
        # The skin carries the measured marker by +p: the model's lies -p from it.
        moved = -np.swapaxes(local @ np.swapaxes(trial.pose.rotation[:, s, None], -1, -2), -1, -2)
        return np.asarray(moved).reshape(len(moved), 3 * on.size, -1)

    @cached_property
    def _parts(self) -> tuple[tuple[int, Index, Index, Index], ...]:
        """Segments that wear markers: index, markers, their rows among 3M, angles beside it."""
        worn, found = np.array(self.body.markers.segment), []
        for s, near in enumerate(_near(self.body)):
            on = np.flatnonzero(worn == s)
            if on.size:
                found.append((s, on, (3 * on[:, None] + np.arange(3)).ravel(), near))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class Sag(_Moved):
    """Markers on flesh that yields to its own weight and acceleration, segment by segment (s²: m per m/s²)."""

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Every segment that wears markers."""
        return tuple(f"sag {part_of(self.body.segments[s])}" for s in self._worn)

    @property
    def _worn(self) -> tuple[int, ...]:
        return tuple(sorted(set(self.body.markers.segment)))

    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        """Yield the acceleration (F, R, 1) less gravity, lab, of the middle of a segment's markers, for each of their
        rows (R,) among 3M: by that they are left behind.
        """
        move = trial.segments
        for s in self._worn:
            on = np.flatnonzero(np.array(self.body.markers.segment) == s)
            # Middle of the markers: its acceleration is that of the origin + dw x r + w x (w x r).
            arm = move.rotation[:, s] @ self.body.markers.position[on].mean(axis=0)
            w = move.angular_velocity[:, s]
            turning = cross(move.angular_acceleration[:, s], arm) + cross(w, cross(w, arm))
            # a - g: at rest +9.81 upwards, so the measured marker hangs below the model's by s times that.
            acceleration = move.acceleration[:, s] + turning - self.body.gravity
            yield np.tile(acceleration, (1, on.size))[:, :, None], (3 * on[:, None] + np.arange(3)).ravel()


@dataclass(frozen=True, eq=False)
class Flesh(_WithAngles):
    """Matter that moves against its segment in proportion to an angle beside it, along the three axes of the segment
    (m/rad).
    """

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Three axes of every segment, times every angle beside it."""
        pairs = zip(self.body.segments, _near(self.body), strict=True)
        return tuple(f"flesh {part_of(name)}" for name, near in pairs for _ in range(3 * near.size))

    def residual(self, trial: Response) -> Array:
        """Return zeros: no marker sees a displaced centre of mass."""
        return np.zeros((len(self.body.markers.names), 3, len(self.groups)))

    def _slopes(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for s, near in enumerate(_near(self.body)):
            # Functionals of a displacement (lab) times R: per metre along the segment's axes.
            yield trial.place[:, s] @ trial.pose.rotation[:, s], near

    def squares(self, trial: Response) -> Array:
        """Return zeros: no marker sees it."""
        return np.zeros(len(self.groups))


def _near(body: Body) -> tuple[Index, ...]:
    """Return for every segment the angles beside it."""
    return tuple(np.flatnonzero(column) for column in neighbours(body).T)


def deviations(body: Body, sources: tuple[ErrorSource, ...]) -> Array:
    """Return (K,) standard deviations of all errors of ``sources``, each in its own unit.

    A joint that a functional calibration placed has the standard deviation that came with it (``body.joint_errors``),
    every other one that of the table before calibration.
    """
    calibrated = {error.joint: {"joint_centre": error.centre, "tilt": error.axis} for error in body.joint_errors}
    found: dict[tuple[str, str], float] = {}
    for group, joint in (
        (group, joint) for source in sources for group, joint in zip(source.groups, source.joints, strict=True)
    ):
        quantity, _, target = group.partition(" ")
        if (group, joint) not in found:
            found[group, joint] = (
                calibrated[joint][quantity] if joint in calibrated else _of_table(quantity, target, joint)
            )
    return np.array([found[pair] for source in sources for pair in zip(source.groups, source.joints, strict=True)])


def _of_table(quantity: str, target: str, joint: str) -> float:
    """Return the size of one kind of error as the table has it."""
    if joint:
        return joint_size(quantity, joint)
    if quantity == "slide":
        return error_size("slide", "marker")
    try:
        return error_size(quantity, target)
    except UnknownName:
        return error_size(quantity, "other")


def of_whole(group: str, body: Body) -> str:
    """Return a group of errors as that of the segment where it is one of a part: ``slide head`` -> ``slide
    trunk_head``.
    """
    wholes = {part_of(part.name): part_of(body.segments[part.segment]) for part in body.parts}
    quantity, _, target = group.partition(" ")
    return f"{quantity} {wholes.get(target, target)}"


CLUSTER_REACH = 0.1
"""m: lever that makes a turn of a marker cluster comparable with its translation."""


def of_clusters(body: Body) -> tuple[ErrorSource, ...]:
    """Return the errors that diagnosis takes for no fault, the markers of a segment sliding as a whole; joint centres
    are causes there.
    """
    return (Slide(body, _patterns(body)), Sag(body), Flesh(body), Tilt(body))


def of_markers(body: Body) -> tuple[Slide, Flesh, Centre, Tilt]:
    """Return the errors with every marker sliding by itself: what identification discounts."""
    worn = [np.sum(np.array(body.markers.segment) == s) for s in range(len(body.segments))]
    # Pattern 3k + i moves marker k along axis i.
    alone = tuple(np.eye(3 * count).reshape(count, 3, 3 * count) for count in worn)
    return (Slide(body, alone), Flesh(body), Centre(body), Tilt(body))


@dataclass(frozen=True, eq=False)
class Errors:
    """What K elementary errors do in one trial.

    ``groups`` (K) such as ``slide thigh`` (m/rad), ``sag thigh`` (s²), ``flesh thigh`` (m/rad), ``joint_centre hip``
    (m), ``tilt knee`` (rad); ``joints`` (K) of the body that they belong to, or ""; ``wrench`` (T, 6, K) added to the
    predicted wrench, predicted less measured, about the lab origin; ``markers`` (M, 3, K) m, mean residual of every
    marker, model less measured, segment axes.
    """

    groups: tuple[str, ...]
    joints: tuple[str, ...]
    wrench: Array
    markers: Array


def forward(sources: tuple[ErrorSource, ...], motion: Motion) -> Errors:
    """Return what the errors of unit size do in ``motion``, at about 25 Hz (what is slower than 6 Hz is then good to
    1 %).
    """
    trial = Response.of(sources[0].body, motion)
    wrench = np.concatenate([trial.wrench(source.functional(trial)) for source in sources], axis=2)
    names, joints = (
        tuple(name for source in sources for name in getattr(source, which)) for which in ("groups", "joints")
    )
    return Errors(names, joints, wrench, np.concatenate([source.residual(trial) for source in sources], axis=2))


def transpose(sources: tuple[ErrorSource, ...], trial: Response, weight: Array) -> Array:
    """Return (K, p): sum over time of ``weight`` (F, 6, p), wrench about the lab origin, times what every error adds
    to the wrench.
    """
    back, sums = trial.back(weight), np.zeros((sum(len(source.groups) for source in sources), weight.shape[2]))
    for frames, part in trial.parts():
        sums += np.concatenate([source.transpose(part, back[frames]) for source in sources])
    return sums


def _patterns(body: Body) -> tuple[Array, ...]:
    """Return per segment the rigid displacements (m, 3, P) of its markers: translations, and turns that move any."""
    worn, found = np.array(body.markers.segment), []
    for s in range(len(body.segments)):
        places = body.markers.position[worn == s]
        middle = places - places.mean(axis=0) if len(places) else places
        # Turn about the markers' middle, in metres at `CLUSTER_REACH`, so that patterns have one unit.
        turns = [np.cross(axis, middle) / CLUSTER_REACH for axis in np.eye(3)]
        kept = [np.tile(axis, (len(places), 1)) for axis in np.eye(3)] + [
            turn for turn in turns if np.abs(turn).max(initial=0) > 1e-6
        ]
        found.append(np.stack(kept, axis=2) if len(places) else np.empty((0, 3, 0)))
    return tuple(found)
