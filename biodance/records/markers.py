"""Where the markers were."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.errors import BiodanceError, known_index
from biodance.records.arrays import Array, any_coordinate, assign, check_time, frozen_array, in_time, rate_of, span

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Markers:
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

    @property
    def rate(self) -> float:
        """Sampling rate, Hz; NaN for fewer than two frames."""
        return rate_of(self.time)

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
