"""A laboratory over all its sessions: its plates judged together, and what it learns from sessions without fault: how
large is no fault, and its healthy reference. What cannot be read is said, the rest goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.cycles import EMG, scores
from biodance.cycles.curves import CurveGroup
from biodance.diagnosis.archive.evidence import plainly_named, plate_evidence
from biodance.diagnosis.archive.judge import ArchiveJudgement, judge_archive
from biodance.diagnosis.archive.norms import (
    Norm,
    SeenValue,
    noise_of_instruments,
    norms,
    seen_by_witnesses,
    sway,
    usual_noise,
)
from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.learning import Null, learn_tolerances, null_of, shown_by
from biodance.diagnosis.own_tolerances import skin_of, soft_tissue
from biodance.diagnosis.problem import problem
from biodance.effects import Recorded, check_quality
from biodance.errors import BiodanceError, SessionRefused, UnknownName
from biodance.lab.session.archive import archive_folders, iso_date, read_index, read_plate_text, visit_date
from biodance.lab.session.read import read_session
from biodance.lab.session.recordings import recordings_in
from biodance.pipeline.judged_trials import cases_of, chosen_windows
from biodance.pipeline.lab_file import NO_LAB, HealthyReference
from biodance.pipeline.movement import describe_movement
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import now
from biodance.pipeline.session import examine
from biodance.records import SIDES, Array, Trial
from biodance.uncertainty.tolerances import InstrumentNoise, Tolerances, shipped, without_habits

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


@dataclass(frozen=True, eq=False)
class MeasuredWalk:
    """How one ``person`` moved in a ``session``: ``curves`` over all good repetitions, ``beside`` those of plug-in
    gait, from the same files or computed here, gait ``vectors`` by side (n, 459) deg.
    """

    session: str
    person: str
    curves: tuple[CurveGroup, ...]
    beside: tuple[CurveGroup, ...]
    vectors: dict[str, Array]


def measured_walk(result: SessionResult, session: str) -> MeasuredWalk:
    """Return how the person of an examined ``session`` moved; without EMG, whose size hangs on skin and electrodes."""
    moved = describe_movement(result)
    groups = (group for one in moved.repetitions.values() for group in one.groups)
    curves = tuple(group for group in groups if not group.quantity.endswith(EMG))
    found = scores.gait_vectors(moved.gait.curves) if moved.gait else {}
    by_side = {side: [vector for cycle, vector in found.items() if cycle.side == side] for side in SIDES}
    vectors = {side: np.stack(rows) for side, rows in by_side.items() if rows}
    beside = moved.gait.beside if moved.gait else ()
    return MeasuredWalk(session, result.subject.name or session, curves, beside, vectors)


def healthy_reference(healthy: Sequence[MeasuredWalk], everybody: Sequence[MeasuredWalk]) -> HealthyReference:
    """Return the reference of ``healthy`` people; patients among ``everybody`` help to find features."""
    people, beside = dict[str, list[CurveGroup]](), dict[str, list[CurveGroup]]()
    legs: dict[tuple[str, str], list[Array]] = {}
    for one in healthy:
        people.setdefault(one.person, []).extend(one.curves)
        beside.setdefault(one.person, []).extend(one.beside)
        for side, rows in one.vectors.items():
            legs.setdefault((one.person, side), []).extend(rows)
    strides = [row for one in everybody for rows in one.vectors.values() for row in rows]
    # as many features (singular vectors) as that cannot be found in fewer strides
    # both of three people tell how far the healthy lie apart
    enough = len(strides) >= scores.FEATURES and len(legs) >= 6
    means = [np.mean(rows, axis=0) for rows in legs.values()]
    deviation = scores.deviation_reference(np.stack(strides), np.stack(means)) if enough else None
    return HealthyReference(scores.normal_curves(people), scores.normal_curves(beside), deviation)


_WORTH = 5.0
"""Sessions that the shipped tolerances count for (docs/decisions/2026-11-22-a-laboratory-learns.md)."""
FEWEST = 3
"""Sessions without which nothing is learned."""


@dataclass(frozen=True, eq=False)
class LearnedSession:
    """What one session teaches: its ``null``, ``instruments``, and numbers ``seen``."""

    name: str
    null: Null
    instruments: InstrumentNoise
    seen: tuple[SeenValue, ...]


@dataclass(frozen=True, eq=False)
class LearnedLaboratory:
    """What a laboratory learned from the ``sessions`` of its ``archive``, at a UTC time (``created``, ISO 8601):
    ``tolerances`` for `diagnose` (None: too few sessions are without fault), ``norms`` of instruments, people and
    witnesses, by size how many coefficients were ``shown`` (0 = as shipped), by session why it was ``left_out``, and
    the ``healthy`` reference, without bands for fewer than three people.
    """

    archive: Path
    created: str
    tolerances: Tolerances | None
    norms: tuple[Norm, ...]
    sessions: tuple[str, ...]
    shown: Mapping[str, float] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    healthy: HealthyReference = NO_LAB

    def __repr__(self) -> str:
        return f"LearnedLaboratory({self.archive.name!r}, {len(self.sessions)} sessions, {self.created})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, tuple(f"{name}: {why}" for name, why in self.left_out.items()))


def learn_laboratory(
    archive: str | Path, *, healthy: Sequence[str] = (), tell: _Tell = lambda _: None
) -> LearnedLaboratory:
    """Return the tolerances and norms of a laboratory, from all its sessions without fault.

    Parameters
    ----------
    archive : str or pathlib.Path
        Folder with session folders at any depth. A session in which a check fails teaches nothing.
    healthy : sequence of str
        Sessions of healthy people, by their place below ``archive``: normal bands and scores rest on these, also where
        a check fails in one; by default on all sessions without fault.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    LearnedLaboratory
        ``tolerances`` for `diagnose`, ``norms`` of instruments, people and witnesses, and what all that rests on.

    Raises
    ------
    SessionRefused
        Fewer than three sessions can be learned from, and ``healthy`` names fewer than three people; the message says
        why of each.
    UnknownName
        ``healthy`` names a session that is not there.

    See Also
    --------
    judge_plates : The plates of the same archive over time.

    References
    ----------
    Expectation maximisation beside the shipped sizes, which count for five sessions; docs/guide/plates.md.

    Examples
    --------
    >>> biodance.learn_laboratory("visit")
    Traceback (most recent call last):
        ...
    biodance.errors.SessionRefused: visit: holds 1 session, at least 3 are needed to learn from.
    """
    folder = Path(archive)
    found, left_out, walks = dict[str, LearnedSession](), dict[str, str](), list[MeasuredWalk]()
    sessions = [path for path in archive_folders(folder)[0] if path != folder]
    if not sessions:
        sessions = [folder]
    elif recordings_in(folder):
        beside = "recordings beside the session folders belong to none of them and are left out"
        tell(f"{folder.resolve().name}: {beside}")
    if len(sessions) < FEWEST:
        held = f"{len(sessions)} session{'s' * (len(sessions) != 1)}"
        raise SessionRefused(f"{folder}: holds {held}, at least {FEWEST} are needed to learn from.")
    names = {path: path.relative_to(folder).as_posix() for path in sessions}
    for name in healthy:
        if name not in names.values():
            raise UnknownName.of(f"session below {folder}", name, tuple(names.values()))
    for k, (path, name) in enumerate(names.items(), 1):
        tell(f"examining {path.name}, {k} of {len(sessions)}")
        try:
            # walks count before the checks do: a healthy person may have been recorded with a faulty plate
            result = examine(read_session(path))
            walks.append(measured_walk(result, name))
            found[name] = learned_session(result)
        except Exception as why:
            left_out[name] = told_failure(why)
    tell("learning")
    chosen = [one for one in walks if one.session in (healthy or found)]
    return learned_together(folder, list(found.values()), left_out, healthy_reference(chosen, walks))


def learned_session(result: SessionResult) -> LearnedSession:
    """Return what one examined session teaches.

    Raises
    ------
    SessionRefused
        It cannot be judged, or a check failed in it.
    TrialRefused
        It has no second of believable, fully measured frames.
    """
    windows, session = chosen_windows(result.trials), result.session
    if result.body is None or not windows:
        raise SessionRefused(f"It has no trial that could be judged. {result.placed.source}")
    checks = check_quality(Recorded(session, cases_of(result.body, windows)))
    if failed := [quality for quality in checks if not quality.ok]:
        raise SessionRefused(
            f"A check failed ({failed[0].check}), so that it is no session without fault: {failed[0].text}"
        )
    # learned are the sizes of causes that have a shipped one to begin with
    put, known = problem(result.body, windows), shipped()
    null = null_of(put, tuple(one for one in candidates(put) if known.knows(one.effect.name)))
    name = session.folder.resolve().name
    mass = session.subject.declared_mass
    own = noise_of_instruments(session.trials, soft_tissue(windows), skin_of(result.body, windows))
    seen = [
        SeenValue("camera_noise", name, own.camera, "m"),
        SeenValue("plate_noise_fz", name, own.plate[2], "N/rtHz"),
    ]
    if (one := result.standing) is not None:
        seen.append(SeenValue("standing sway", name, sway(one.cop), "m"))
        for side, size in (("ahead", one.com_ahead), ("left", one.com_left)) if one.com.size else ():
            seen.append(SeenValue(f"standing centre of mass {side} of pressure", name, size, "m"))
        if "mass" not in session.subject.guessed:
            seen.append(SeenValue("plates less declared mass", name, one.mass - mass, "kg"))
    return LearnedSession(name, null, own, (*seen, *seen_by_witnesses(session.trials, name, mass)))


def learned_together(
    archive: Path,
    sessions: list[LearnedSession],
    left_out: Mapping[str, str],
    healthy: HealthyReference = NO_LAB,
) -> LearnedLaboratory:
    """Return what the sessions teach together, beside the ``healthy`` reference. Raises SessionRefused: fewer than
    three sessions, and no band of healthy people.
    """
    names, seen = tuple(one.name for one in sessions), norms([row for one in sessions for row in one.seen])
    if len(sessions) < FEWEST and healthy.normal:
        return LearnedLaboratory(archive, now(), None, seen, names, {}, dict(left_out), healthy)
    if len(sessions) < FEWEST:
        why = " ".join(f"{name}: {reason}" for name, reason in list(left_out.items())[:FEWEST])
        raise SessionRefused(
            f"{archive}: {len(sessions)} of {len(sessions) + len(left_out)} sessions can be learned from, at least "
            f"{FEWEST} are needed. {why}"
        )
    nulls, created = [one.null for one in sessions], now()
    found = without_habits(learn_tolerances(nulls, shipped(), rounds=10, worth=_WORTH))
    origin = (
        f"{len(sessions)} sessions of {archive.resolve().name}, {created[:10]}, beside the shipped sizes as "
        f"{_WORTH:g} sessions more"
    )
    tolerances = replace(found, origin=origin, instruments=usual_noise([one.instruments for one in sessions]))
    shown = shown_by(nulls, tolerances)
    return LearnedLaboratory(archive, created, tolerances, seen, names, shown, dict(left_out), healthy)
