"""The sessions of one laboratory read and judged together; what cannot be read is said, the rest goes on."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from biodance import display
from biodance.diagnosis.archive.evidence import plainly_named, plate_evidence
from biodance.diagnosis.archive.judge import ArchiveJudgement, judge_archive
from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.errors import BiodanceError, SessionRefused
from biodance.lab.session.archive import archive_folders, iso_date, read_index, read_plate_text, visit_date
from biodance.lab.session.read import read_session
from biodance.records import Trial

if TYPE_CHECKING:
    import pandas as pd

_Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class PlatesJudged:
    """The plates of a laboratory over all visits of its ``archive``: the ``judgement`` (cards of the plates, changes,
    kinds of trial, people who stand out), ``observations`` of every plate in every trial, by session or recording why
    it was ``refused``, and ``notes`` on what was guessed.
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
    undated = sum(not visit.date for visit in judged.visits)
    note = (
        f"{undated} of {len(judged.visits)} visits have no date: all are in the order of their names. Write "
        f"[session] date into session.toml."
    )
    return PlatesJudged(folder, judged, named, refused, (note,) if undated else ())


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
        found = list(plate_evidence(session.trials, visit, mass=session.subject.declared_mass))
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
        trials, conditions = list[Trial](), dict[str, Mapping[str, str]]()
        for row in own:
            try:
                trials.append(read_plate_text(row.path))
                conditions[trials[-1].name] = row.conditions
            except BiodanceError as why:
                refused[row.path.name] = str(why)
        visit = PlateVisit(name, own[0].person, iso_date(own[0].date))
        found += plate_evidence(trials, visit, mass=own[0].mass, conditions=conditions)
    return found
