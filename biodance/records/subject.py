"""The person."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from biodance.errors import SessionRefused

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
