"""One visit of one person: subject, trials, and where they came from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from biodance import display
from biodance.errors import BiodanceError, TrialRefused, known_index
from biodance.records.arrays import assign, by_name, rate_of
from biodance.records.markers import Markers
from biodance.records.recording import Defect, FootEvent, LeftOutSpan, Source
from biodance.records.subject import Subject
from biodance.records.wrench import Plate, Wrench
from biodance.settings import USUAL, Settings

if TYPE_CHECKING:
    import pandas as pd


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
