"""One visit of one person: subject, trials, and where they came from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from biodance import display
from biodance.errors import BiodanceError, SessionRefused, TrialRefused, known_index
from biodance.records.arrays import Array, assign, by_name, freeze, rate_of
from biodance.records.wrench import Defect, FootEvent, LeftOutSpan, Markers, Plate, Source, Wrench
from biodance.settings import USUAL, Settings

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

    @property
    def declared_mass(self) -> float:
        """The declared body mass, kg; NaN where nobody declared it."""
        return float("nan") if "mass" in self.guessed else self.mass

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
    *("mass (kg)", "com x (m)", "com y (m)", "com z (m)"),
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


Role = Literal["static", "fit", "validate", "check", "skip"]
ROLES: tuple[Role, ...] = ("static", "fit", "validate", "check", "skip")


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording: markers and/or force plates, with its role and its history.

    Parameters
    ----------
    name : str
        Of the file, without extension.
    role : {"static", "fit", "validate", "check", "skip"}
        What it is for.
    markers : Markers or None
        As recorded, in m, z up.
    plates : tuple of Plate
        Those that can be trusted.
    source : Source
        File, hash, rates.
    marker_set : str
        Name of the recognised set, or "".
    measurements : mapping
        The subject's measures stored in the file, m and kg (``Bodymass``, ``LLegLength`` ...).
    history : tuple of str
        What was done with which parameters, in sentences: signs, zeros, units, gaps, filters.
    warnings : tuple of str
        What a person should look at.
    settings : Settings
        What the analyst chose when it was read.
    defects : tuple of Defect
        What was wrong in the recording and was left out.
    left_out : tuple of LeftOutSpan
        What the analyst leaves out.
    events : tuple of FootEvent
        Strikes and offs that the analyst set by hand, in the place of all that would be found of their foot.

    Examples
    --------
    >>> session["squat_1"]
    Trial('squat_1', validate, 39 markers (plug_in_gait), 1 plate, 6.10 s)
    """

    name: str
    role: Role
    markers: Markers | None
    plates: tuple[Plate, ...]
    source: Source
    marker_set: str = ""
    measurements: Mapping[str, float] = field(default_factory=dict)
    history: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    settings: Settings = USUAL
    defects: tuple[Defect, ...] = ()
    left_out: tuple[LeftOutSpan, ...] = ()
    events: tuple[FootEvent, ...] = ()

    def __post_init__(self) -> None:
        known_index("trial role", self.role, ROLES)
        listed = ("plates", "history", "warnings", "defects", "left_out", "events")
        assign(self, **{name: tuple(getattr(self, name)) for name in listed})
        assign(self, measurements=MappingProxyType(dict(self.measurements)))

    @property
    def worn(self) -> str:
        """Name of the marker set for a reader: of a guessed one without its map."""
        return self.marker_set.partition(" {")[0]

    def __repr__(self) -> str:
        row = self._row()
        worn = f"{row['markers']} markers ({self.worn or 'no known set'})" if self.markers is not None else "no markers"
        plates = f"{len(self.plates)} plate{'s' if len(self.plates) != 1 else ''}"
        return f"Trial({self.name!r}, {self.role}, {worn}, {plates}, {row['duration (s)']:.2f} s)"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, (*(f"Warning: {text}" for text in self.warnings), *self.history))

    def _row(self) -> dict[str, Any]:
        """Return what the table of a session says about this trial."""
        clock = self.markers or (self.plates[0].wrench if self.plates else None)
        time = np.zeros(0) if clock is None else clock.time
        return {
            "trial": self.name,
            "role": self.role,
            "duration (s)": float(time[-1] - time[0]) if time.size else float("nan"),
            "frames": time.size,
            "rate (Hz)": rate_of(time),
            "markers": len(self.markers.names) if self.markers is not None else 0,
            "marker set": self.worn,
            "plates": len(self.plates),
            "warnings": len(self.warnings),
        }

    @property
    def floor(self) -> float:
        """Mean height of the plates' surfaces, m; 0 without plates."""
        return float(np.mean([plate.height for plate in self.plates])) if self.plates else 0.0

    @property
    def wrench(self) -> Wrench:
        """Total wrench of all plates about the lab origin; TrialRefused without plates or with different time bases."""
        if not self.plates:
            raise TrialRefused(
                f"Trial {self.name}: no force plate was recorded, so there is no wrench. Record with the plates on."
            )
        time = self.plates[0].wrench.time
        others = [p.wrench for p in self.plates[1:]]
        if any(one.time is not time and not np.array_equal(one.time, time) for one in others):
            raise TrialRefused(f"Trial {self.name}: the plates have different time bases; prepare the trial first.")
        value = sum((one.value for one in others), self.plates[0].wrench.value)
        value.setflags(write=False)  # the record keeps it without a copy
        return Wrench(time, value)


@dataclass(frozen=True, eq=False)
class Session:
    """One visit of one person: ``session["squat_1"]`` is a trial, and a session can be iterated over.

    Parameters
    ----------
    subject : Subject
        The person.
    trials : tuple of Trial
        Those that could be read, all with the same settings.
    folder : pathlib.Path
        Where they lie.
    refused : mapping
        File name -> the sentence why it could not be read.
    notes : tuple of str
        Guesses made (roles by name, sex unknown ...), one sentence each.

    Raises
    ------
    BiodanceError
        The trials were read with different settings.

    Examples
    --------
    >>> session = biodance.read_session("visit")
    >>> session
    Session('visit', 3 trials: dance_1 (fit), squat_1 (validate), static (static))
    >>> [trial.name for trial in session]
    ['dance_1', 'squat_1', 'static']
    >>> session["squat1"]
    Traceback (most recent call last):
        ...
    biodance.errors.UnknownName: 'squat1' is not a trial of session visit. Did you mean 'squat_1'? Legal: dance_1,
    squat_1, static.
    """

    subject: Subject
    trials: tuple[Trial, ...]
    folder: Path
    refused: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if any(trial.settings != self.settings for trial in self.trials):
            raise BiodanceError(
                "The trials of this session were read with different settings. Read them again together."
            )

    def __repr__(self) -> str:
        first = ", ".join(f"{trial.name} ({trial.role})" for trial in self.trials[:6])
        more = f", and {len(self.trials) - 6} more" if len(self.trials) > 6 else ""
        left = f"; {len(self.refused)} files refused" if self.refused else ""
        return f"Session({self.folder.name!r}, {len(self.trials)} trials: {first}{more}{left})"

    def _repr_html_(self) -> str:
        refused = (f"Refused: {why}" for why in self.refused.values())
        return display.card(repr(self), self.table(), (*refused, *self.notes))

    def __getitem__(self, name: str) -> Trial:
        """Return the trial of that name; UnknownName lists all names."""
        return by_name(self.trials, name, f"trial of session {self.folder.name}")

    def __contains__(self, name: str) -> bool:
        return any(trial.name == name for trial in self.trials)

    def __iter__(self) -> Iterator[Trial]:
        return iter(self.trials)

    def __len__(self) -> int:
        return len(self.trials)

    @property
    def settings(self) -> Settings:
        """What the analyst chose, the same for all trials."""
        return self.trials[0].settings if self.trials else USUAL

    def of_role(self, *roles: Role) -> tuple[Trial, ...]:
        """Return the trials with one of some roles.

        Parameters
        ----------
        *roles : {"static", "fit", "validate", "check", "skip"}
            The roles wanted.

        Returns
        -------
        tuple of Trial
            In the order of the session.

        Examples
        --------
        >>> [trial.name for trial in session.of_role("fit", "validate")]
        ['dance_1', 'squat_1']
        """
        return tuple(t for t in self.trials if t.role in roles)

    def table(self) -> "pd.DataFrame":
        """Return one row for each trial.

        Returns
        -------
        pandas.DataFrame
            Index trial; role, duration (s), frames, rate (Hz), markers, marker set, plates, warnings.

        Examples
        --------
        >>> session.table()["role"].to_list()
        ['fit', 'validate', 'static']
        """
        import pandas as pd

        rows = [trial._row() for trial in self.trials]
        return pd.DataFrame(rows).set_index("trial") if rows else pd.DataFrame()
