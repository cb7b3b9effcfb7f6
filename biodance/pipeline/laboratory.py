"""A laboratory: its file lab.toml (accepted corrections, its own tolerances, the bands of its people; nothing is
believed of a stranger's file but what it may say, in the range of every number), and its sessions read and judged
together; what cannot be read is said, the rest goes on.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from biodance import display
from biodance.cycles.curves import NormalCurve, normal_of
from biodance.cycles.scores import DeviationReference, deviation_of
from biodance.diagnosis.archive.evidence import plainly_named, plate_evidence
from biodance.diagnosis.archive.judge import ArchiveJudgement, judge_archive
from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.effects import FAMILY
from biodance.errors import BiodanceError, FileRefused, SessionRefused
from biodance.lab.corrections import (
    PlateCorrection,
    corrected_session,
    corrections_text,
    joined_corrections,
    read_corrections,
)
from biodance.lab.session.archive import (
    IndexedTrial,
    archive_folders,
    iso_date,
    read_index,
    read_plate_text,
    visit_date,
)
from biodance.lab.session.read import read_session
from biodance.library import read_toml
from biodance.records import Session, Trial
from biodance.uncertainty.tolerances import Tolerances, shipped, tolerances_of

if TYPE_CHECKING:
    import pandas as pd


LAB = "lab.toml"
"""Name under which it is written."""
PLUG_IN_GAIT = "normal_plug_in_gait"
"""Its table of the bands of plug-in gait's own angles."""


@dataclass(frozen=True, eq=False)
class LabFile:
    """What a lab.toml says: ``corrections`` of the plates, ``tolerances`` of the laboratory's own or None, and the
    ``normal`` bands of its people, those of plug-in gait's angles ``beside``, and what the gait deviation index is told
    against, or None.
    """

    corrections: tuple[PlateCorrection, ...] = ()
    tolerances: Tolerances | None = None
    normal: tuple[NormalCurve, ...] = ()
    beside: tuple[NormalCurve, ...] = ()
    deviation: DeviationReference | None = None

    def corrected(self, session: Session) -> Session:
        """Return a session as read, corrected."""
        return corrected_session(session, self.corrections) if self.corrections else session


NO_LAB = LabFile()


def read_lab(path: str | Path | None) -> LabFile:
    """Return what the file of a laboratory says; nothing without a file.

    Raises
    ------
    FileRefused
        It cannot be read, or says what cannot be corrected.
    """
    if path is None:
        return NO_LAB
    corrections = read_corrections(path)
    whole = read_toml(Path(path))
    if fault := lab_fault(whole):
        raise FileRefused(f"{path}: {fault}. Give a lab.toml that biodance learn or diagnose --accept wrote.")
    raw, where = whole.get("tolerances"), "norms"
    try:
        norms = {name: (float(one["value"]), float(one["sd"])) for name, one in whole.get("norms", {}).items()}
        where = "tolerances"
        known, where = replace(tolerances_of(raw), norms=norms) if raw else None, "normal"
        normal, where = normal_of(whole.get("normal", {})), PLUG_IN_GAIT
        beside, where = normal_of(whole.get(PLUG_IN_GAIT, {})), "gait_deviation_index"
        return LabFile(corrections, known, normal, beside, deviation_of(whole.get("gait_deviation_index")))
    except (KeyError, TypeError, ValueError, BiodanceError) as error:
        raise FileRefused(f"{path}: [{where}] is not what `biodance learn` writes ({error}).") from error


def lab_text(earlier: tuple[PlateCorrection, ...], accepted: tuple[PlateCorrection, ...]) -> str:
    """Return the lab.toml that holds what was corrected ``earlier`` and what lasts of what was ``accepted``; "" for
    nothing.
    """
    lasting = tuple(one for one in accepted if one.fault.lasting)
    return corrections_text(joined_corrections(earlier, lasting))


Positive = Annotated[float, Field(gt=0, le=1e6)]
Finite = Annotated[float, Field(ge=-1e12, le=1e12)]
_Row = Annotated[list[Finite], Field(min_length=6, max_length=6)]
_Squares = Annotated[list[Annotated[float, Field(gt=0, le=1e12)]], Field(min_length=6, max_length=6)]
_Words = Annotated[str, Field(max_length=10_000)]
_PerCent = Annotated[list[float], Field(min_length=2, max_length=101)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Instruments(_Table):
    camera_m: Positive | None = None
    plate_n_per_root_hz: Annotated[list[Positive], Field(max_length=6)] = []
    marker_distance_m: Positive | None = None
    skin_m: Annotated[list[Positive], Field(max_length=100)] = []
    swing_m: Annotated[list[Positive], Field(max_length=100)] = []


class _Tolerances(_Table):
    origin: _Words
    threshold: Annotated[float, Field(ge=0, le=1e4)]
    movement: list[_Squares] = Field(max_length=100)
    noise: list[Annotated[list[_Row], Field(min_length=6, max_length=6)]] = Field(max_length=100)
    sizes: dict[str, Annotated[float, Field(ge=0, le=1e6)]] = {}
    means: dict[str, Finite] = {}
    accuracy: dict[str, Annotated[float, Field(ge=0, le=10)]] = {}
    instruments: _Instruments = _Instruments()


class _Norm(_Table):
    value: Finite
    sd: Positive
    between_sessions_sd: Annotated[float, Field(ge=0, le=1e12)] = 0.0
    unit: str = ""
    sessions: int = Field(1, ge=0)
    observations: int = Field(1, ge=0)


class _Band(_Table):
    """NaN where less than two people are known."""

    unit: str
    people: int = Field(ge=1)
    mean: _PerCent
    sd: _PerCent


class _Deviation(_Table):
    """Of the gait deviation index: features (k, 459), the healthy (k,), mean and sd of their distance's logarithm."""

    basis: Annotated[list[Annotated[list[Finite], Field(min_length=459, max_length=459)]], Field(max_length=459)]
    control: Annotated[list[Finite], Field(max_length=459)]
    mean: Finite
    sd: Positive


class _Laboratory(_Table):
    learned_utc: Any = None
    archive: str = ""
    sessions: list[str] = []


class LabContents(_Table):
    """The tables of a lab.toml; ``corrections`` are checked where they are made (`lab.corrections`)."""

    laboratory: _Laboratory = _Laboratory()
    corrections: dict[str, Any] = {}
    tolerances: _Tolerances | None = None
    norms: dict[str, _Norm] = {}
    normal: dict[str, _Band] = {}
    normal_plug_in_gait: dict[str, _Band] = {}
    gait_deviation_index: _Deviation | None = None


def lab_fault(raw: dict[str, Any]) -> str:
    """Return the first thing in a lab.toml that is not legal, in words: where, value and what is legal; "" for none."""
    try:
        LabContents.model_validate(raw)
    except ValidationError as error:
        one = error.errors()[0]
        place = ".".join(str(part) for part in one["loc"])
        if one["type"] == "extra_forbidden":
            return f"[{place}] is nothing that biodance learn writes"
        return f"{place} = {repr(one['input'])[:60]}: {one['msg'][0].lower()}{one['msg'][1:]}"
    known = {*(key.split()[0] for key in shipped().sizes), *FAMILY.members()}
    sizes = raw.get("tolerances", {}).get("sizes", {})
    strange = next((key for key in sizes if not {*key.split()[:1]} & known), None)
    return "" if strange is None else f"tolerances.sizes: {strange[:60]!r} is the size of nothing that is known"


_Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class PlatesJudged:
    """The plates of a laboratory over all its visits.

    Parameters
    ----------
    archive : pathlib.Path
        Its folder.
    judgement : ArchiveJudgement
        Cards of the plates, changes, kinds of trial, people who stand out.
    observations : tuple of PlateEvidence
        What every trial says of every plate.
    refused : mapping
        Session or recording -> why it was left out.
    notes : tuple of str
        What was guessed.
    """

    archive: Path
    judgement: ArchiveJudgement
    observations: tuple[PlateEvidence, ...]
    refused: Mapping[str, str]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        found = self.judgement
        counts = {"visit": found.visits, "plate": found.plates, "finding": found.findings}
        told = ", ".join(f"{len(some)} {what}{'s' * (len(some) != 1)}" for what, some in counts.items())
        return f"PlatesJudged({self.archive.name!r}: {told})"

    def _repr_html_(self) -> str:
        said = (f"{card.plate}: {one.text}" for card in self.judgement.plates for one in card.findings)
        return display.card(repr(self), self.table(), tuple(said))

    def table(self) -> "pd.DataFrame":
        """Return one row for each visit and plate: what the visit says of it, for the laboratory's own records.

        Returns
        -------
        pandas.DataFrame
            date, visit, person, plate, and of every quantity the mean over the trials of the visit, its standard error
            and the number of trials: ``place_x_m``, ``place_x_sd_m``, ``place_x_trials`` ...
        """
        import pandas as pd

        from biodance.diagnosis.archive.quantities import daily_rows

        return pd.DataFrame(daily_rows(self.observations))


def judge_plates(archive: str | Path, *, tell: _Tell = lambda _: None) -> PlatesJudged:
    """Return what all sessions of a laboratory say of its plates.

    Parameters
    ----------
    archive : str or pathlib.Path
        Folder with session folders at any depth, or with a table ``trials.csv`` beside text recordings of one plate.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    PlatesJudged
        A card per plate (place m, gain, offset N, delay s), change points with date and interval, kinds of trial that
        read otherwise, people who stand out.

    Raises
    ------
    SessionRefused
        There is no session in the folder, or none says anything of a plate.

    See Also
    --------
    learn_laboratory : The tolerances of the same archive.

    References
    ----------
    A mixed model of visits, persons and plates; docs/guide/plates.md.

    Examples
    --------
    >>> judged = biodance.judge_plates("visit")
    >>> judged
    PlatesJudged('visit': 1 visit, 1 plate, 0 findings)
    >>> judged.table()["plate"].to_list()
    ['plate1']
    """
    folder = Path(archive)
    sessions, indices = archive_folders(folder)
    refused: dict[str, str] = {}
    observations: list[PlateEvidence] = []
    for k, path in enumerate(sessions, 1):
        tell(f"reading {path.name}, {k} of {len(sessions)}")
        observations += _of_session(path, folder, refused)
    for path in indices:
        tell(f"reading what {path.name} names")
        observations += _of_index(path, refused)
    if not observations:
        why = next(iter(refused.values()), "No plate is ever empty, and nobody stands still on one.")
        raise SessionRefused(f"{folder}: no session says anything of a plate. {why}")
    tell("judging the plates")
    named = plainly_named(observations)
    judged = judge_archive(named)
    undated = [visit.name for visit in judged.visits if not visit.date]
    notes = (
        (
            f"{len(undated)} of {len(judged.visits)} visits have no date: all are in the order of their names. Write "
            f"[session] date into session.toml.",
        )
        if undated
        else ()
    )
    return PlatesJudged(folder, judged, named, refused, notes)


def told_failure(why: Exception) -> str:
    """Return why a session was left out: its own sentence, or that biodance failed on it, which stops no other."""
    if isinstance(why, BiodanceError):
        return str(why)
    return f"biodance failed on it ({type(why).__name__}: {why}). Please report it."


def _of_session(path: Path, archive: Path, refused: dict[str, str]) -> list[PlateEvidence]:
    """Return what one session folder says; it is refused with a reason instead of stopping the rest."""
    name = path.relative_to(archive).as_posix() if path != archive else path.resolve().name
    try:
        session = read_session(path)
        visit = PlateVisit(name, session.subject.name, visit_date(path))
        mass = float("nan") if "mass" in session.subject.guessed else session.subject.mass
        found = list(plate_evidence(session.trials, visit, mass=mass))
    except Exception as why:
        refused[name] = told_failure(why)
        return []
    refused.update({f"{name}/{file}": why for file, why in session.refused.items()})
    if not found:
        refused[name] = "says nothing of a plate: none is ever empty, and nobody stands still on one."
    return found


def _of_index(path: Path, refused: dict[str, str]) -> list[PlateEvidence]:
    """Return what the recordings that a table names say."""
    try:
        rows = read_index(path)
    except BiodanceError as why:
        refused[path.name] = str(why)
        return []
    found: list[PlateEvidence] = []
    for name in dict.fromkeys(row.visit for row in rows):
        own = [row for row in rows if row.visit == name]
        trials, conditions = _plate_trials(own, refused)
        visit = PlateVisit(name, own[0].person, iso_date(own[0].date))
        found += plate_evidence(trials, visit, mass=own[0].mass, conditions=conditions)
    return found


def _plate_trials(
    rows: list[IndexedTrial], refused: dict[str, str]
) -> tuple[list[Trial], dict[str, Mapping[str, str]]]:
    """Return the recordings of a visit that can be read, and the conditions of each."""
    trials: list[Trial] = []
    conditions: dict[str, Mapping[str, str]] = {}
    for row in rows:
        try:
            trials.append(read_plate_text(row.path))
        except BiodanceError as why:
            refused[row.path.name] = str(why)
            continue
        conditions[trials[-1].name] = row.conditions
    return trials, conditions
