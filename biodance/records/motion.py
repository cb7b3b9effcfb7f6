"""How a body moved."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.errors import BiodanceError, known_index
from biodance.records.arrays import Array, Sampled, assign, check_time, freeze, frozen_array, in_time, runs, span

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Encoders(Sampled):
    """Joint angles over ``time`` (T,) s, on the robot's own clock: ``angle`` (T, n) rad of ``joints`` (n); ``notes`` on
    what was decided on reading.
    """

    time: Array
    joints: tuple[str, ...]
    angle: Array
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = check_time(self.time, "Encoders")
        angle = frozen_array(self.angle, (time.size, len(self.joints)), "Encoders.angle")
        assign(self, time=time, joints=tuple(self.joints), angle=angle, notes=tuple(self.notes))


BY_FRAME = ("time", "q", "v", "a", "residual", "determined", "state")
"""Fields of a `Motion` that have one row a frame."""


class AngleState(IntEnum):
    """How a joint angle of one frame was found."""

    MEASURED = 0
    """From markers that were seen in this frame."""
    FILLED = 1
    """Only with markers that were put into a gap of the recording."""
    NOT_DETERMINED = 2
    """The frame's markers leave it open: a guess from the frames before and after, which no export shows."""

    @property
    def words(self) -> str:
        """Return the state as tables write it."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True)
class AngleSpan:
    """A run of frames in which the angle of a ``joint`` is not measured: ``start`` to ``end`` s, both included."""

    joint: str
    state: AngleState
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class Motion(Sampled):
    """Generalised motion of a body, in Pinocchio's order.

    Parameters
    ----------
    time : array_like
        (T,) s.
    q : array_like
        (T, nq). A free-flyer root comes first: x y z m, quaternion x y z w, then joint angles rad.
    v, a : array_like
        (T, nv) velocity and acceleration; of the root linear, then angular, in the root's OWN frame; m/s, rad/s and per
        s.
    residual : array_like
        (T, K) m, distance of every marker to the model; NaN = not seen.
    marker_names : tuple of str
        (K) labels.
    determined : array_like of bool
        (T,) False where a frame's own markers did not give its posture; by default all True.
    notes : tuple of str
        How the motion was found, in sentences.
    joint_names : tuple of str
        (n) names of the joint angles, the last n columns of q; () = not known.
    state : array_like of int
        (T, n) `AngleState` of every joint angle; by default measured. In a frame that is not ``determined`` and does
        not say which angle is open, none is.

    Examples
    --------
    >>> motion = result["squat_1"].motion
    >>> motion.q.shape, motion.v.shape
    ((611, 30), (611, 29))
    """

    time: Array
    q: Array
    v: Array
    a: Array
    residual: Array = field(default_factory=lambda: np.empty((0, 0)))
    marker_names: tuple[str, ...] = ()
    determined: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))
    notes: tuple[str, ...] = ()
    joint_names: tuple[str, ...] = ()
    state: NDArray[np.int8] = field(default_factory=lambda: np.empty(0, dtype=np.int8))

    def __post_init__(self) -> None:
        time = check_time(self.time, "Motion")
        frames = time.size
        residual = self.residual if np.size(self.residual) else np.empty((frames, 0))
        determined = np.array(self.determined, dtype=bool) if np.size(self.determined) else np.ones(frames, dtype=bool)
        if determined.shape != (frames,):
            raise BiodanceError(f"Motion.determined has shape {determined.shape}, expected ({frames},).")
        determined.setflags(write=False)
        assign(self, time=time, determined=determined, residual=residual)
        assign(self, **{name: tuple(getattr(self, name)) for name in ("notes", "marker_names", "joint_names")})
        freeze(self, "Motion", v=(frames, None), q=(frames, None), residual=(frames, len(self.marker_names)))
        freeze(self, "Motion", a=(frames, self.v.shape[1]))
        if self.joint_names and self._root + len(self.joint_names) != self.q.shape[1]:
            names, columns = len(self.joint_names), self.q.shape[1]
            raise BiodanceError(
                f"Motion.joint_names has {names} names for {columns} columns of q, {self._root} of them the root's."
            )
        joints = self.q.shape[1] - self._root
        state = np.array(self.state if np.size(self.state) else np.zeros((frames, joints)), dtype=np.int8)
        if state.shape != (frames, joints):
            raise BiodanceError(f"Motion.state has shape {state.shape}, expected ({frames}, {joints}).")
        # an open frame that names no open angle: any of them may be the one
        unsaid = ~determined & (state != AngleState.NOT_DETERMINED).all(axis=1)
        state[unsaid] = AngleState.NOT_DETERMINED
        state.setflags(write=False)
        assign(self, state=state)

    def __repr__(self) -> str:
        left = int(np.sum(~self.determined))
        open_frames = f", {left} frames left open" if left else ""
        return f"Motion({self.q.shape[1] - self._root} joint angles, {span(self.time)}{open_frames})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table().describe(), self.notes)

    @property
    def _root(self) -> int:
        """Columns of q that are the root's: 7 with a free flyer, else 0."""
        return 7 if self.q.shape[1] == self.v.shape[1] + 1 else 0

    def at(self, frames: slice | NDArray[np.intp] | NDArray[np.bool_]) -> "Motion":
        """Return some frames alone: their time, positions, velocities and accelerations, which kinematics need.

        Parameters
        ----------
        frames : slice or numpy.ndarray
            Which, by index.

        Returns
        -------
        Motion
            Without residuals, names and notes.

        Examples
        --------
        >>> result["squat_1"].motion.at(slice(0, 100)).time.size
        100
        """
        return Motion(self.time[frames], self.q[frames], self.v[frames], self.a[frames])

    @property
    def angles(self) -> Array:
        """Joint angles, (T, n) DEGREES, anatomical signs; for people: the record itself is in rad."""
        return np.degrees(self.q[:, self._root :])

    @property
    def known_angles(self) -> Array:
        """Joint angles as `angles`, (T, n) degrees; NaN where they are not determined."""
        return np.where(self.state == AngleState.NOT_DETERMINED, np.nan, self.angles)

    @property
    def frame_state(self) -> NDArray[np.int8]:
        """(T,) `AngleState` of every frame: filled where any angle is, not determined where its posture is not."""
        filled = (self.state == AngleState.FILLED).any(axis=1)
        worst = np.where(filled, AngleState.FILLED, AngleState.MEASURED)
        return np.where(self.determined, worst, AngleState.NOT_DETERMINED).astype(np.int8)

    def spans(self) -> tuple[AngleSpan, ...]:
        """Return where every joint angle is filled or not determined, joint by joint, in the order of time.

        Returns
        -------
        tuple of AngleSpan
            () where all angles were measured.

        Examples
        --------
        >>> result["squat_1"].motion.spans()
        ()
        """
        return tuple(
            AngleSpan(joint, kind, float(self.time[start]), float(self.time[stop - 1]))
            for k, joint in enumerate(self._titles)
            for start, stop, kind in sorted(
                (*run, kind)
                for kind in (AngleState.FILLED, AngleState.NOT_DETERMINED)
                for run in runs(self.state[:, k] == kind)
            )
        )

    @property
    def _titles(self) -> tuple[str, ...]:
        return self.joint_names or tuple(f"joint_{k + 1}" for k in range(self.q.shape[1] - self._root))

    def table(self) -> "pd.DataFrame":
        """Return posture over time as a table.

        Returns
        -------
        pandas.DataFrame
            Index time (s); ``root x (m)`` ..., ``root qx`` ... (quaternion), then joint angles, ``left_knee_flexion
            (deg)`` and so on; NaN where they are not determined.

        Examples
        --------
        >>> bool(result["squat_1"].motion.table()["left_knee_flexion (deg)"].max() > 60)
        True
        """
        root = (*(f"root {axis} (m)" for axis in "xyz"), *(f"root q{axis}" for axis in "xyzw"))[: self._root]
        # the root has no state of its own: it is known wherever the posture is
        placed = np.where(self.determined[:, None], self.q[:, : self._root], np.nan)
        values = np.concatenate([placed, self.known_angles], axis=1)
        return in_time(self.time, values, (*root, *(f"{name} (deg)" for name in self._titles)))

    def plot_angles(self, *joints: str, axes: "Axes | None" = None) -> "Axes":
        """Draw joint angles over time.

        Parameters
        ----------
        *joints : str
            Names of joint angles; none: all.
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Degrees over seconds.

        Raises
        ------
        UnknownName
            There is no such joint angle; the legal names are listed.

        Examples
        --------
        >>> len(result["squat_1"].motion.plot_angles("left_knee_flexion", "right_knee_flexion").lines)
        2
        """
        names = self._titles
        columns = [known_index("joint angle of this motion", joint, names) for joint in joints or names]
        shown, chosen = self.known_angles[:, columns], [names[k] for k in columns]
        return display.curves(self.time, shown, chosen, "angle (deg)", axes=axes)
