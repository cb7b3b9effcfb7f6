"""What a laboratory learns from sessions without fault: how large is no fault, and its healthy reference."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from biodance import display
from biodance.cycles import EMG
from biodance.cycles.curves import CurveGroup
from biodance.cycles.scores import (
    FEATURES,
    deviation_reference,
    gait_vectors,
    normal_curves,
)
from biodance.diagnosis.archive.norms import (
    Norm,
    SeenValue,
    noise_of_instruments,
    norms,
    seen_by_witnesses,
    sway,
    usual_noise,
)
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.learning import Null, learn_tolerances, null_of, shown_by
from biodance.diagnosis.own_tolerances import skin_of, soft_tissue
from biodance.diagnosis.problem import problem
from biodance.effects import Recorded, check_quality
from biodance.errors import SessionRefused, UnknownName
from biodance.lab.session.archive import archive_folders
from biodance.lab.session.read import read_session
from biodance.lab.session.recordings import recordings_in
from biodance.pipeline.judged_trials import cases_of, chosen_windows
from biodance.pipeline.lab_file import NO_LAB, HealthyReference
from biodance.pipeline.movement import describe_movement
from biodance.pipeline.plates import told_failure
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import now
from biodance.pipeline.session import examine
from biodance.records import SIDES, Array
from biodance.uncertainty.tolerances import InstrumentNoise, Tolerances, shipped, without_habits

_FEWEST_LEGS = 6
"""Healthy legs without which nothing is said of how far healthy people lie apart: both of three people."""


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
    found = gait_vectors(moved.gait.curves) if moved.gait else {}
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
    enough = len(strides) >= FEATURES and len(legs) >= _FEWEST_LEGS
    means = [np.mean(rows, axis=0) for rows in legs.values()]
    deviation = deviation_reference(np.stack(strides), np.stack(means)) if enough else None
    return HealthyReference(normal_curves(people), normal_curves(beside), deviation)


_WORTH = 5.0
"""Sessions that the shipped tolerances count for (docs/decisions/2026-11-22-a-laboratory-learns.md)."""
FEWEST = 3
"""Sessions without which nothing is learned."""
ROUNDS = 10
_Tell = Callable[[str], None]


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
    found = without_habits(learn_tolerances(nulls, shipped(), rounds=ROUNDS, worth=_WORTH))
    origin = (
        f"{len(sessions)} sessions of {archive.resolve().name}, {created[:10]}, beside the shipped sizes as "
        f"{_WORTH:g} sessions more"
    )
    tolerances = replace(found, origin=origin, instruments=usual_noise([one.instruments for one in sessions]))
    shown = shown_by(nulls, tolerances)
    return LearnedLaboratory(archive, created, tolerances, seen, names, shown, dict(left_out), healthy)
