"""The person, and the standard inertial parameters (SIP) of a body with their covariance."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from biodance import display
from biodance.errors import SessionRefused, known_index
from biodance.records.arrays import Array, assign, freeze

if TYPE_CHECKING:
    import pandas as pd

SIDES = ("right", "left")
"""Of a person, in the order of every array over feet or hands."""


def side_in_name(name: str, otherwise: str = "middle") -> str:
    """Return the side, one of `SIDES`, that the name of a segment begins with."""
    return next((side for side in SIDES if name.startswith(side)), otherwise)


@dataclass(frozen=True)
class FootSizes:
    """The outline of one foot.

    Parameters
    ----------
    length : float
        Heel to toe tip, m.
    breadth : float
        At the ball, m.
    heel_breadth : float
        Of the heel, m.

    Examples
    --------
    >>> foot = biodance.FootSizes(0.264, 0.101, 0.069)
    >>> person = biodance.Subject(62.0, 1.70, "F", foot_outline={"right": foot, "left": foot})
    >>> person.foot_outline["left"].breadth
    0.101
    """

    length: float
    breadth: float
    heel_breadth: float


@dataclass(frozen=True)
class Subject:
    """The person.

    Parameters
    ----------
    mass : float
        Body mass, kg; NaN = not known: a step that needs it refuses with the remedy.
    stature : float
        Stature, m; NaN = not known.
    sex : {"F", "M"}
        Whose tables are used.
    age : float
        Years; NaN = not known, always possible.
    name : str
        As the lab calls the person.
    measurements : mapping
        Other measures by name, m and kg.
    guessed : tuple of str
        What nobody declared: "mass", "stature", "sex".
    girths : mapping
        Girths m by name: ``thigh`` of both sides or ``right_thigh`` of one; see docs/guide/record.md.
    scan : str
        File of a scanned standing person, a closed surface in m; "" = none.
    scan_up : {"z", "y", "x"}
        Axis of that file that points up.
    foot_outline : mapping
        `FootSizes` by side, right and left; empty = not measured.
    prosthesis : str
        First segment of a limb that is a prosthesis (``left_shank``): nothing is known of its matter; "" = none.
    devices : mapping
        What is worn, kg by segment, known; ``mass`` holds it.

    Examples
    --------
    >>> biodance.Subject(62.0, 1.70, "F", 31.0).stature
    1.7
    """

    mass: float
    stature: float
    sex: Literal["F", "M"]
    age: float = float("nan")
    name: str = ""
    measurements: Mapping[str, float] = field(default_factory=dict)
    guessed: tuple[str, ...] = ()
    girths: Mapping[str, float] = field(default_factory=dict)
    scan: str = ""
    scan_up: Literal["z", "y", "x"] = "z"
    foot_outline: Mapping[str, FootSizes] = field(default_factory=dict)
    prosthesis: str = ""
    devices: Mapping[str, float] = field(default_factory=dict)

    def require(self, *quantities: Literal["mass", "stature", "age"]) -> None:
        """Refuse to go on where a quantity is not known.

        Parameters
        ----------
        *quantities : {"mass", "stature", "age"}
            What a step needs.

        Raises
        ------
        SessionRefused
            One of them is NaN; the message says which key of session.toml helps.

        Examples
        --------
        >>> biodance.Subject(62.0, 1.70, "F").require("age")
        Traceback (most recent call last):
            ...
        biodance.errors.SessionRefused: Subject: the age is not known. Set age in session.toml.
        """
        keys = {"mass": "mass_kg", "stature": "height_m", "age": "age"}
        unknown = [quantity for quantity in quantities if np.isnan(getattr(self, quantity))]
        if unknown:
            verb, wanted = "is" if len(unknown) == 1 else "are", " and ".join(keys[quantity] for quantity in unknown)
            raise SessionRefused(
                f"{self.name or 'Subject'}: the {' and '.join(unknown)} {verb} not known. Set {wanted} in session.toml."
            )


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
