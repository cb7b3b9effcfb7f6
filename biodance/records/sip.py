"""Standard inertial parameters of the segments, with their covariance."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.errors import known_index
from biodance.records.arrays import Array, assign, freeze

if TYPE_CHECKING:
    import pandas as pd

_INERTIAL = (
    "mass (kg)",
    "com x (m)",
    "com y (m)",
    "com z (m)",
    *(f"I{axes} (kg·m²)" for axes in ("xx", "xy", "yy", "xz", "yz", "zz")),
)
"""Columns of a table of segments: centre of mass and inertia in and about the segment's joint frame."""


@dataclass(frozen=True, eq=False)
class Sip:
    """Standard inertial parameters of N segments with their covariance.

    Parameters
    ----------
    segments : tuple of str
        (N) names.
    phi : array_like
        (10N,) segment after segment, each [m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] (Pinocchio's order) in kg,
        kg·m, kg·m²; first moment and inertia about and in the segment's JOINT frame.
    covariance : array_like
        (10N, 10N) in the same units.
    measured : tuple of str
        Segments whose masses rest on more than a table: girths of the person.

    Raises
    ------
    BiodanceError
        Shapes do not fit together.

    Examples
    --------
    >>> sip = result.body.sip
    >>> sip.segments[0], round(float(sip.mass.sum()), 1)
    ('pelvis', 61.9)
    """

    segments: tuple[str, ...]
    phi: Array
    covariance: Array
    measured: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = 10 * len(self.segments)
        assign(self, segments=tuple(self.segments), measured=tuple(self.measured))
        freeze(self, "Sip", phi=(n,), covariance=(n, n))

    def __repr__(self) -> str:
        return f"Sip({len(self.segments)} segments, {self.mass.sum():.2f} kg)"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table())

    def of(self, segment: str) -> Array:
        """Return the ten parameters of one segment.

        Parameters
        ----------
        segment : str
            Its name.

        Returns
        -------
        numpy.ndarray
            (10,) in the order of `phi`.

        Raises
        ------
        UnknownName
            There is no such segment; the legal names are listed.

        Examples
        --------
        >>> result.body.sip.of("pelvis").shape
        (10,)
        """
        i = known_index("segment", segment, self.segments)
        return self.phi[10 * i : 10 * i + 10]

    @property
    def mass(self) -> Array:
        """Masses, (N,) kg."""
        return self.phi[::10]

    @property
    def com(self) -> Array:
        """Centres of mass in the segments' joint frames, (N, 3) m; NaN for a massless segment."""
        table = self.phi.reshape(-1, 10)
        mass = np.where(table[:, :1] > 0, table[:, :1], np.nan)
        return table[:, 1:4] / mass

    def table(self) -> "pd.DataFrame":
        """Return one row for each segment.

        Returns
        -------
        pandas.DataFrame
            Index segment; ``mass (kg)``, ``mass sd (kg)``, ``com x (m)`` ..., ``Ixx (kg·m²)`` ..., in and about the
            segment's joint frame.

        Examples
        --------
        >>> bool(result.body.sip.table().loc["pelvis", "mass (kg)"] > 5)
        True
        """
        import pandas as pd

        values = np.concatenate([self.mass[:, None], self.com, self.phi.reshape(-1, 10)[:, 4:]], axis=1)
        out = pd.DataFrame(values, index=pd.Index(self.segments, name="segment"), columns=list(_INERTIAL))
        out.insert(1, "mass sd (kg)", np.sqrt(np.maximum(np.diag(self.covariance)[::10], 0.0)))
        return out
