"""What the pipeline found in one session: the records that the report draws and that results.json holds. Computes
nothing.

All records are frozen; arrays are in SI units in the lab frame (z up); a wrench is the ground's action on the subject
about the lab origin.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.body.body import Body
from biodance.lab.markers.gaps import MarkerGaps
from biodance.records import CHANNEL_TITLES, Array, Motion, Session, Subject, Trial, by_name
from biodance.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

    from biodance.pipeline.identification import SessionIdentification

Status = Literal["ok", "warning", "refused"]


@dataclass(frozen=True)
class Step:
    """One step on one trial or on the session.

    ``status`` "done"; "refused": the data cannot carry it, ``text`` says why and what to do; "failed": a fault of
    biodance itself.
    """

    name: str
    status: Literal["done", "refused", "failed"]
    text: str = ""


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """Distance of the markers to the model: per marker ``names`` (K), ``rms`` and ``max`` (K,) m, NaN = never seen;
    all together in m.
    """

    names: tuple[str, ...]
    rms: Array
    max: Array
    total_rms: float
    total_max: float


@dataclass(frozen=True, eq=False)
class WrenchComparison:
    """Measured beside simulated wrench.

    ``time`` (T,) s; ``measured``, ``simulated`` (T, 6) N, N·m about the lab origin; ``used`` (T,) True where the plates
    measure all that the ground does; ``rms`` (6,) N, N·m and ``correlation`` (6,) over the used frames, NaN = not
    defined; ``notes`` why frames were left out.
    """

    time: Array
    measured: Array
    simulated: Array
    used: NDArray[np.bool_]
    rms: Array
    correlation: Array
    notes: tuple[str, ...] = ()

    def table(self) -> "pd.DataFrame":
        """Return measured and simulated wrench over time, and whether a frame is used.

        Returns
        -------
        pandas.DataFrame
            Index time (s); ``Fx measured (N)`` ..., ``Fx simulated (N)`` ... about the lab origin, ``used``.

        Examples
        --------
        >>> result["squat_1"].comparison.table().shape[1]
        13
        """
        import pandas as pd

        titles = [title.replace(" (", f" {which} (") for which in ("measured", "simulated") for title in CHANNEL_TITLES]
        out = pd.DataFrame(np.hstack([self.measured, self.simulated]), pd.Index(self.time, name="time (s)"), titles)
        return out.assign(used=self.used)

    def plot_wrench(self) -> NDArray[Any]:
        """Draw the measured beside the simulated wrench; frames that are not used are grey.

        Returns
        -------
        numpy.ndarray
            (6,) matplotlib axes: Fx, Fy, Fz, Mx, My, Mz over time.

        Examples
        --------
        >>> result["squat_1"].comparison.plot_wrench()[2].get_ylabel()
        'Fz (N)'
        """
        return display.side_by_side(self.time, self.measured, self.simulated, self.used, CHANNEL_TITLES)


@dataclass(frozen=True, eq=False)
class QuietStanding:
    """A quiet standing on the plates from ``start`` to ``end`` s; ``mass`` kg on the plates (mean vertical force / g),
    ``mass_sd`` kg.

    ``cop`` and ``com`` (T, 2) m, horizontal lab coordinates of the centre of pressure and of the table's centre of mass
    (``com`` empty without a tracked motion); ``forward`` (2,) unit vector the subject faces; ``com_ahead``,
    ``com_left`` m: mean of CoM minus CoP along it and to its left; ``feet`` (F, 2) m foot landmarks and their
    ``foot_names`` (``left_heel`` ...); ``plates`` (P, 4, 2) m corners.
    """

    trial: str
    start: float
    end: float
    mass: float
    mass_sd: float
    cop: Array
    com: Array
    forward: Array
    com_ahead: float
    com_left: float
    feet: Array
    foot_names: tuple[str, ...]
    plates: Array


@dataclass(frozen=True, eq=False)
class Still:
    """One instant to draw in 3-D.

    ``bones`` (B, 2, 3) m lines with ``sides`` (B) "left", "right" or "middle"; ``markers`` (K, 3) m as measured;
    ``plates`` (P, 4, 3) m corners; ``com`` (3,) m; ``force`` and ``cop`` (3,) N, m of the total wrench (NaN =
    unloaded); ``forward`` (2,) unit vector the subject faces. ``boxes`` (N, 2, 3) m of the segments with ``rotations``
    (N, 3, 3) and ``positions`` (N, 3) m in the lab and their ``box_sides``; ``residual`` (3,) N measured minus
    predicted force, ``load`` (3,) m place of a load that was found (NaN = none); ``about`` what the picture shows, one
    sentence.
    """

    trial: str
    time: float
    bones: Array
    sides: tuple[str, ...]
    markers: Array
    plates: Array
    com: Array
    force: Array
    cop: Array
    forward: Array
    boxes: Array = field(default_factory=lambda: np.empty((0, 2, 3)))
    rotations: Array = field(default_factory=lambda: np.empty((0, 3, 3)))
    positions: Array = field(default_factory=lambda: np.empty((0, 3)))
    box_sides: tuple[str, ...] = ()
    residual: Array = field(default_factory=lambda: np.full(3, np.nan))
    load: Array = field(default_factory=lambda: np.full(3, np.nan))
    about: str = ""


@dataclass(frozen=True)
class Check:
    """One row of the quality table: ``value`` as text with unit, the ``limit`` it is held against, and whether it is
    inside.
    """

    what: str
    where: str
    value: str
    limit: str
    inside: bool
    advice: str = ""


@dataclass(frozen=True, eq=False)
class TrialResult:
    """One trial after all steps: ``trial`` prepared (as read where preparing was refused); ``gaps`` as recorded, before
    any was filled.

    None where the data could not carry a result.
    """

    trial: Trial
    steps: tuple[Step, ...]
    gaps: tuple[MarkerGaps, ...] = ()
    fit: MarkerFit | None = None
    motion: Motion | None = None
    comparison: WrenchComparison | None = None
    standing: QuietStanding | None = None
    checks: tuple[Check, ...] = ()

    def __repr__(self) -> str:
        close = f", markers {1000 * self.fit.total_rms:.1f} mm from the body" if self.fit else ""
        return f"TrialResult({self.name!r}, {self.trial.role}, {self.status}{close})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, self.reasons)

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.trial.name

    @property
    def gaps_percent(self) -> float:
        """Share of all marker samples that were not seen, %; NaN without markers."""
        return float(np.mean([gap.percent for gap in self.gaps])) if self.gaps else float("nan")

    @property
    def status(self) -> Status:
        """State of the trial: "refused" where no step after preparing was done, "warning" where a person must look,
        "ok" otherwise.
        """
        if all(step.status != "done" or step.name == "prepare" for step in self.steps):
            return "refused"
        return "warning" if self.reasons else "ok"

    @property
    def reasons(self) -> tuple[str, ...]:
        """All refusals and warnings of this trial, each once, in order."""
        refusals = [step.text for step in self.steps if step.status != "done"]
        return tuple(dict.fromkeys([*refusals, *self.trial.warnings]))

    @property
    def reason(self) -> str:
        """The `reasons` as one text; "" if there are none."""
        return " ".join(self.reasons)


@dataclass(frozen=True, eq=False)
class SessionResult:
    """A whole visit after all stages: ``result["squat_1"]`` is what was found in one trial.

    Parameters
    ----------
    session : Session
        As read.
    subject : Subject
        The person.
    body : Body or None
        That moved; None: no markers, mass or stature.
    body_source : str
        Where the body comes from, in words.
    steps : tuple
        What was done with the session, and what was refused with the reason.
    trials : tuple
        What was found in every trial: motion, comparison of the wrenches, quality.
    checks : tuple
        The session's own rows of the quality table.
    standing : Standing or None
        The quiet standing whose weight is compared with the declared mass, or None.
    still : Still or None
        One instant to draw, or None.
    identification : SessionIdentification or None
        None where no trial is to be identified from, or it was refused.
    more_stills : tuple of Still
        The frame with the largest residual force, and a load that was found.

    Examples
    --------
    >>> result
    SessionResult('visit': static ok, dance_1 ok, squat_1 ok)
    >>> result["squat_1"]
    TrialResult('squat_1', validate, ok, markers 6.8 mm from the body)
    """

    session: Session
    subject: Subject
    body: Body | None
    body_source: str
    steps: tuple[Step, ...]
    trials: tuple[TrialResult, ...]
    checks: tuple[Check, ...]
    standing: QuietStanding | None
    still: Still | None
    identification: "SessionIdentification | None" = None
    more_stills: tuple[Still, ...] = ()

    def __repr__(self) -> str:
        return (
            f"SessionResult({self.session.folder.name!r}: "
            f"{', '.join(f'{one.name} {one.status}' for one in self.trials)})"
        )

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), [self.body_source])

    def __getitem__(self, name: str) -> TrialResult:
        """Return what was found in the trial of that name; UnknownName lists all names."""
        return by_name(self.trials, name, f"trial of session {self.session.folder.name}")

    def __iter__(self) -> Iterator[TrialResult]:
        return iter(self.trials)

    def __len__(self) -> int:
        return len(self.trials)

    def table(self) -> "pd.DataFrame":
        """Return one row for each trial.

        Returns
        -------
        pandas.DataFrame
            Index trial; role, status, markers to the body (mm, RMS and largest), measured frames, RMS difference of
            force (N) and moment (N·m, about the lab origin) between plates and simulation with the table, reason.

        Examples
        --------
        >>> list(result.table().index)
        ['static', 'dance_1', 'squat_1']
        """
        import pandas as pd

        return pd.DataFrame([_row(one) for one in self.trials]).set_index("trial")

    @property
    def settings(self) -> Settings:
        """All that the analyst chose."""
        return self.session.settings

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """The session's own checks, then those of every trial."""
        return (*self.checks, *(check for trial in self.trials for check in trial.checks))

    @property
    def mass_difference(self) -> float:
        """Mass on the plates minus declared mass in % of the declared; NaN where either is unknown."""
        return 100 * (self.standing.mass / self.declared_mass - 1) if self.standing else float("nan")

    @property
    def declared_mass(self) -> float:
        """The declared body mass, kg; NaN where nobody declared it."""
        return float("nan") if "mass" in self.subject.guessed else self.subject.mass

    @property
    def stopped(self) -> bool:
        """Whether Ctrl-C ended the run before all trials were done."""
        return any(step.name == "stop" for trial in self.trials for step in trial.steps)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What the body's notes warn about: contradictory measures, improbable lengths, misplaced markers."""
        return tuple(note for note in (self.body.notes if self.body else ()) if note.startswith("Warning"))

    @property
    def failures(self) -> Mapping[str, str]:
        """What identification could not compute, each with cause and cure."""
        return self.identification.failures if self.identification else {}

    @property
    def needs_a_person(self) -> bool:
        """Whether anything was refused, warned about, not computed or outside its limit."""
        trouble = (
            bool(self.failures)
            or any(step.status != "done" for step in self.steps)
            or any(t.status != "ok" for t in self.trials)
        )
        return (
            trouble or bool(self.session.refused or self.doubts) or any(not check.inside for check in self.all_checks)
        )


def _row(one: TrialResult) -> dict[str, Any]:
    """Return what the table of a session says about one trial."""
    nan, found = float("nan"), one.comparison
    return {
        "trial": one.name,
        "role": one.trial.role,
        "status": one.status,
        "marker rms (mm)": 1000 * one.fit.total_rms if one.fit else nan,
        "marker largest (mm)": 1000 * one.fit.total_max if one.fit else nan,
        "measured frames": int(found.used.sum()) if found else 0,
        "force rms (N)": float(np.linalg.norm(found.rms[:3])) if found else nan,
        "moment rms (N·m)": float(np.linalg.norm(found.rms[3:])) if found else nan,
        "reason": one.reason,
    }
