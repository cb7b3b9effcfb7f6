"""What was measured, and what is known of it: markers, and the wrench of the ground, in all and by plate."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.errors import BiodanceError, known_index
from biodance.records.arrays import (
    CHANNEL_TITLES,
    CHANNELS,
    Array,
    Mask,
    Sampled,
    any_coordinate,
    assign,
    check_time,
    freeze,
    frozen_array,
    in_time,
    runs,
    span,
)
from biodance.settings import COP_FORCE, FORCE_DOWN, SHORTEST_CONTACT
from biodance.spatial import zero_moment_point

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Source:
    """Where a trial came from: the file (``path``), ``sha256`` of its bytes, the ``format`` that it was read as,
    ``rate`` and ``analog_rate`` (Hz; NaN = none), and the number of its ``first_frame`` there.
    """

    path: Path
    sha256: str
    format: str
    rate: float = float("nan")
    analog_rate: float = float("nan")
    first_frame: int = 1


@dataclass(frozen=True)
class Defect:
    """What was wrong in a recording and was left out when it was read: an ``effect`` by its name (``dead_plate``) at a
    ``target`` (``plate1``; "" = the whole recording), what was seen and done in a sentence (``text``), and its ``size``
    (NaN = none) in a ``unit``.
    """

    effect: str
    target: str
    text: str
    size: float = float("nan")
    unit: str = ""


@dataclass(frozen=True)
class LeftOutSpan:
    """Seconds ``start`` to ``end`` left out, in a trial by the analyst: of a ``side`` its cycles, of "" forces and all
    cycles.
    """

    start: float
    end: float
    side: str = ""

    def __str__(self) -> str:
        return f"{self.start:g} to {self.end:g} s{f' ({self.side})' if self.side else ''}"


@dataclass(frozen=True)
class FootEvent:
    """``time`` s on the clock of the trial; ``side`` "right" or "left"; ``down`` True where the foot comes down (a
    strike), False where it leaves (an off); ``source`` "force" where a plate saw it, "markers" where the movement of
    the feet tells it, "hand" where session.toml says it, "file" where a C3D file does.
    """

    time: float
    side: str
    down: bool
    source: Literal["force", "markers", "hand", "file"] = "force"


@dataclass(frozen=True, eq=False)
class Markers(Sampled):
    """Marker trajectories in the lab frame.

    Parameters
    ----------
    names : tuple of str
        (K) labels as in the file, each once.
    time : array_like
        (T,) s, increasing.
    xyz : array_like
        (T, K, 3) m, lab frame, z up; NaN where a marker was not seen.
    filled : array_like of bool
        (T, K) True where a place was put into a gap (`fill_gaps`); by default nowhere.

    Raises
    ------
    BiodanceError
        Shapes do not fit together, time does not increase, or a name occurs twice.

    Examples
    --------
    >>> markers = session["squat_1"].markers
    >>> markers["LASI"].shape
    (611, 3)
    >>> "LASI" in markers
    True
    """

    names: tuple[str, ...]
    time: Array
    xyz: Array
    filled: NDArray[np.bool_] = field(default_factory=lambda: np.empty((0, 0), dtype=bool))

    def __post_init__(self) -> None:
        names = tuple(self.names)
        time = check_time(self.time, "Markers")
        assign(self, names=names, time=time, xyz=frozen_array(self.xyz, (time.size, len(names), 3), "Markers.xyz"))
        if len(set(names)) != len(names):
            twice = sorted({n for n in names if names.count(n) > 1})
            raise BiodanceError(f"Marker names occur twice: {', '.join(twice)}.")
        filled = np.array(self.filled, dtype=bool)
        if filled.size and filled.shape != (time.size, len(names)):
            raise BiodanceError(f"Markers.filled has shape {filled.shape}, expected ({time.size}, {len(names)}).")
        filled.setflags(write=False)
        assign(self, filled=filled)

    def __repr__(self) -> str:
        return f"Markers({len(self.names)} markers, {span(self.time)})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table().describe())

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Where a marker was seen, (T, K) bool; read-only."""
        seen = np.logical_not(any_coordinate(np.isnan(self.xyz)))
        seen.setflags(write=False)
        return seen

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Where a marker was seen by the cameras and not put into a gap, (T, K) bool."""
        return self.seen & ~self.filled if self.filled.size else self.seen

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> Array:
        """Return the trajectory (T, 3) m of one marker by its label."""
        return self.xyz[:, known_index("marker of this trial", name, self.names)]

    def select(self, names: Iterable[str]) -> "Markers":
        """Return only the named markers, in the order given.

        Parameters
        ----------
        names : iterable of str
            Labels of this record.

        Returns
        -------
        Markers
            With the same times.

        Raises
        ------
        UnknownName
            A label is not there; the legal ones are named.

        Examples
        --------
        >>> session["squat_1"].markers.select(["LASI", "RASI"]).names
        ('LASI', 'RASI')
        """
        names = tuple(names)
        if names == self.names:
            return self
        chosen = [known_index("marker of this trial", name, self.names) for name in names]
        xyz = self.xyz.take(chosen, axis=1)
        xyz.setflags(write=False)  # the record keeps it without a copy
        return Markers(names, self.time, xyz, self.filled[:, chosen] if self.filled.size else self.filled)

    def table(self) -> "pd.DataFrame":
        """Return the trajectories as a table.

        Returns
        -------
        pandas.DataFrame
            Index time (s); three columns a marker, ``LASI x (m)`` and so on, lab frame.

        Examples
        --------
        >>> list(session["squat_1"].markers.table().columns[:3])
        ['RASI x (m)', 'RASI y (m)', 'RASI z (m)']
        """
        columns = [f"{name} {axis} (m)" for name in self.names for axis in "xyz"]
        return in_time(self.time, self.xyz.reshape(self.time.size, -1), columns)

    def plot_xyz(self, name: str, *, axes: "Axes | None" = None) -> "Axes":
        """Draw the three coordinates of one marker over time.

        Parameters
        ----------
        name : str
            Label of the marker.
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Metres over seconds.

        Examples
        --------
        >>> session["squat_1"].markers.plot_xyz("LASI").get_ylabel()
        'LASI (m)'
        """
        return display.curves(self.time, self[name], ("x", "y", "z"), f"{name} (m)", axes=axes)


@dataclass(frozen=True, eq=False)
class Wrench(Sampled):
    """Force and moment of the ground ON the subject, about the lab origin.

    Parameters
    ----------
    time : array_like
        (T,) s, increasing.
    value : array_like
        (T, 6) force N, then moment N·m about the lab origin, lab frame (z up): Fz > 0 while somebody stands.

    Raises
    ------
    BiodanceError
        Shapes do not fit together or time does not increase.

    Examples
    --------
    >>> import numpy as np
    >>> standing = biodance.Wrench([0.0, 0.01], np.tile([0, 0, 700.0, 70.0, -140.0, 0], (2, 1)))
    >>> standing.cop()[0]
    array([0.2, 0.1, 0. ])
    """

    time: Array
    value: Array

    def __post_init__(self) -> None:
        time = check_time(self.time, "Wrench")
        assign(self, time=time, value=frozen_array(self.value, (time.size, 6), "Wrench.value"))

    def __repr__(self) -> str:
        mean = f", mean Fz {np.nanmean(self.value[:, 2]):.0f} N" if np.isfinite(self.value[:, 2]).any() else ""
        return f"Wrench({span(self.time)}{mean})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table().describe())

    @property
    def force(self) -> Array:
        """Force on the subject, (T, 3) N, lab frame."""
        return self.value[:, :3]

    @property
    def moment(self) -> Array:
        """Moment about the lab origin, (T, 3) N·m, lab frame."""
        return self.value[:, 3:]

    def cop(self, *, height: float = 0.0, threshold: float = COP_FORCE) -> Array:
        """Return the centre of pressure on a horizontal plane.

        Parameters
        ----------
        height : float
            Height of the plane over the lab origin, m.
        threshold : float
            N: with less vertical force there is no centre of pressure.

        Returns
        -------
        numpy.ndarray
            (T, 3) m, lab frame; NaN where ``|Fz| < threshold``.

        Examples
        --------
        >>> session["squat_1"].wrench.cop().shape[1]
        3
        """
        return zero_moment_point(self.value, height=height, threshold=threshold)

    def table(self) -> "pd.DataFrame":
        """Return the wrench as a table.

        Returns
        -------
        pandas.DataFrame
            Index time (s); columns ``Fx (N)`` to ``Mz (N·m)``, about the lab origin.

        Examples
        --------
        >>> list(session["squat_1"].wrench.table().columns)
        ['Fx (N)', 'Fy (N)', 'Fz (N)', 'Mx (N·m)', 'My (N·m)', 'Mz (N·m)']
        """
        return in_time(self.time, self.value, CHANNEL_TITLES)

    def plot_force(self, *, axes: "Axes | None" = None) -> "Axes":
        """Draw the three forces over time.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Newtons over seconds.

        Examples
        --------
        >>> session["squat_1"].wrench.plot_force().get_ylabel()
        'force (N)'
        """
        return display.curves(self.time, self.force, CHANNELS[:3], "force (N)", axes=axes)

    def plot_moment(self, *, axes: "Axes | None" = None) -> "Axes":
        """Draw the three moments about the lab origin over time.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Newton metres over seconds.

        Examples
        --------
        >>> session["squat_1"].wrench.plot_moment().get_ylabel()
        'moment (N·m)'
        """
        return display.curves(self.time, self.moment, CHANNELS[3:], "moment (N·m)", axes=axes)


_REACHED = 0.1
"""Share of the largest force that a contact reaches: while a runner flies, the belt shakes, and a low-passed force
swings, beyond `FORCE_DOWN`, too, and toes that scrape a plate press as much."""


def contacts(wrench: Wrench) -> Mask:
    """Return (T,) where something stands on what a ``wrench`` was measured by: its vertical force exceeds `FORCE_DOWN`
    and reaches `_REACHED` of the largest before it ends. A flicker joins the contact that it interrupts.
    """
    time, force = wrench.time, np.nan_to_num(wrench.force[:, 2])
    found = np.asarray(force > FORCE_DOWN)
    for start, stop in runs(found):
        found[start:stop] = force[start:stop].max() > _REACHED * force.max()
    # Gaps first, then contacts.
    for value in (False, True):
        for start, stop in runs(found == value):
            if start > 0 and stop < found.size and time[stop] - time[start] < SHORTEST_CONTACT:
                found[start:stop] = not value
    return found


def contact_times(wrench: Wrench) -> Array:
    """Return (n, 2) s from when until when each of the `contacts` lasts, the passing of `FORCE_DOWN` linearly between
    two samples; NaN where one began before the recording or went on after it.
    """
    time, force = wrench.time, np.nan_to_num(wrench.force[:, 2])
    ends = np.array(runs(contacts(wrench)), dtype=int).reshape(-1, 2)
    seen = (ends > 0) & (ends < time.size)
    at = ends[seen]
    share = np.clip((FORCE_DOWN - force[at - 1]) / (force[at] - force[at - 1]), 0, 1)
    found = np.full(ends.shape, np.nan)
    found[seen] = time[at - 1] + share * (time[at] - time[at - 1])
    return found


@dataclass(frozen=True, eq=False)
class Plate:
    """One force plate of one trial.

    Parameters
    ----------
    name : str
        As in the lab's numbering (``plate1``).
    type : int
        C3D TYPE; 0 for native files.
    corners : array_like
        (4, 3) m, lab frame, in file order.
    wrench : Wrench
        Ground on subject about the LAB origin, at analog rate as read, at marker times once prepared.
    decisions : tuple of str
        Sign, zero, units, corner order: what was decided and why, in sentences.
    zero : array_like
        (3,) N that the EMPTY plate read and that was subtracted, lab frame, as if it acted on the subject.
    placed : bool
        Whether the file says where the plate lies; False: ``corners`` only enclose the centres of pressure.
    foot : {"", "left", "right"}
        The foot that stands on it, where the analyst says so; "" = the one that the markers show.
    columns : str
        What a table calls the plate, by which it is known again there; "" where the file numbers its plates.
    put : array_like or None
        (2,) m where the point of its moments was put by the feet that stand on it; None where the file or the analyst
        says the place.
    loaded : array_like
        (n, 2) s from when until when the vertical force as recorded shows `contacts` (NaN: before or
        after the recording), once prepared: a low-pass smears the sudden beginning of a step to up to 34 ms before it.
    peaks : Wrench or None
        The wrench at the times of ``wrench``, low-passed as little as their rate allows, once prepared: what is slow
        enough for joint moments has lost some per cent of the peaks.

    Examples
    --------
    >>> session["squat_1"].plates[0]
    Plate('plate1', TYPE 2, 6110 frames at 1000 Hz, 6.11 s)
    """

    name: str
    type: int
    corners: Array
    wrench: Wrench
    decisions: tuple[str, ...] = ()
    zero: Array = field(default_factory=lambda: np.zeros(3))
    placed: bool = True
    foot: str = ""
    columns: str = ""
    put: Array | None = None
    loaded: Array = field(default_factory=lambda: np.zeros((0, 2)))
    peaks: Wrench | None = None

    def __post_init__(self) -> None:
        put = None if self.put is None else frozen_array(self.put, (2,), f"{self.name}.put")
        assign(self, decisions=tuple(self.decisions), put=put)
        freeze(self, self.name, corners=(4, 3), zero=(3,), loaded=(None, 2))

    @property
    def tared(self) -> bool:
        """Whether the empty plate read something in this recording, which the reader took off (`zero`)."""
        return bool(self.zero.any())

    def __repr__(self) -> str:
        return f"Plate({self.name!r}, TYPE {self.type}, {span(self.wrench.time)})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.wrench.table().describe(), self.decisions)

    @property
    def centre(self) -> Array:
        """Mean of the corners, (3,) m, lab frame."""
        return self.corners.mean(axis=0)

    @property
    def height(self) -> float:
        """Height of the plate's centre over the lab origin, m."""
        return float(self.corners[:, 2].mean())
