"""The wrench of the ground on the subject, in all and by plate."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.records.arrays import (
    CHANNEL_TITLES,
    CHANNELS,
    Array,
    assign,
    check_time,
    freeze,
    frozen_array,
    in_time,
    rate_of,
    span,
)
from biodance.settings import COP_FORCE
from biodance.spatial import zero_moment_point

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Wrench:
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
    def rate(self) -> float:
        """Sampling rate, Hz; NaN for fewer than two samples."""
        return rate_of(self.time)

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

    def __post_init__(self) -> None:
        put = None if self.put is None else frozen_array(self.put, (2,), f"{self.name}.put")
        assign(self, decisions=tuple(self.decisions), put=put)
        freeze(self, self.name, corners=(4, 3), zero=(3,))

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
