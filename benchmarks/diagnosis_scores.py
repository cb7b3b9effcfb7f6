"""What a diagnosis is worth, given what was hidden: one `Score` a session, stored as JSON so that a run that was
stopped goes on.
"""

import json
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from diagnosis_contamination import contamination
from hidden_causes import MEASURED, Name, truth
from hidden_sessions import CACHE, Scenario, examined

from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.diagnosis.observability import detection_limits
from biodance.diagnosis.problem import problem
from biodance.effects import discrete_effects, effects
from biodance.pipeline.diagnosis import diagnose_session
from biodance.virtual_lab.faults.causes import parse_cause

SIGMAS = 1.959964


@dataclass(frozen=True)
class Score:
    """One session judged.

    ``names`` what was named, in order, ``sets`` the sets; ``exact``, ``within`` per hidden cause: named as such, in a
    set; ``ratio`` size over the limit that this session computed for it, ``told`` over the size from which it is told
    from the others (NaN = not computed); ``size_error`` relative, ``covered`` by the 95 % interval (NaN, None = no size
    to compare); ``gain`` as in the JSON, with the errors of the masses; ``seconds`` of the processor, ``planned`` of
    them for what the movement alone decides, before any force is looked at; ``verdict`` "crashed" where there is no
    answer, ``note`` says why.
    """

    key: str
    group: str
    level: str
    subject: int
    hidden: tuple[str, ...]
    verdict: str
    names: tuple[Name, ...]
    sets: tuple[tuple[Name, ...], ...]
    exact: tuple[bool, ...]
    within: tuple[bool, ...]
    ratio: float
    told: float
    size_error: float
    covered: bool | None
    worst: tuple[str, float]
    seconds: float
    gain: dict[str, Any] = field(default_factory=dict)
    note: str = ""
    planned: float = 0.0

    @property
    def silent(self) -> bool:
        """Whether nothing was found wrong, nor anything that keeps the session from telling."""
        return self.verdict in ("nothing wrong", "cannot tell")

    @property
    def wrong(self) -> bool:
        """Whether a name was given whose set does not hold the truth."""
        return bool(self.names) and not all(self.within)


def share(hits: Iterable[bool]) -> str:
    """Return "k of n (p %)" of true values."""
    found = list(hits)
    return f"{sum(found)} of {len(found)} ({100 * sum(found) / len(found):.0f} %)" if found else "none measured"


def judge(scenario: Scenario, *, absent: bool = False) -> Score:
    """Diagnose a session and judge the answer; ``absent`` takes the files of the hidden causes out of the family of
    effects first.
    """
    result = examined(scenario)
    gone = {name for names in truth(scenario) for name, _ in names} if absent else set()
    left = {name: kind for name, kind in {**effects(), **discrete_effects()}.items() if name not in gone}
    planned = Clock()
    start = time.process_time()
    with (
        patch("biodance.effects.causes", lambda chosen=None: left if chosen is None else chosen),
        patch("biodance.diagnosis.engine.problem", planned.timed(problem)),
        patch("biodance.diagnosis.naming.candidates", planned.timed(candidates)),
        patch("biodance.diagnosis.engine.detection_limits", planned.timed(detection_limits)),
    ):
        found = diagnose_session(result, effects=left)
    seconds = time.process_time() - start
    harm = contamination(scenario, result, found) if scenario.judged and not absent else {}
    one = score(scenario, found.diagnosis, seconds, group="absent" if absent else scenario.group, harm=harm)
    return replace(one, planned=planned.seconds)


class Clock:
    """Processor time of the first calls of some functions: what they make of the movement and the table could be
    made before a session.
    """

    def __init__(self) -> None:
        self.seconds = 0.0

    def timed(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return ``call`` with its first use on the clock."""
        used = False

        def same(*parts: Any, **named: Any) -> Any:
            nonlocal used
            start = time.process_time()
            try:
                return call(*parts, **named)
            finally:
                self.seconds += 0.0 if used else time.process_time() - start
                used = True

        return same


def score(scenario: Scenario, found: Diagnosis, seconds: float, *, group: str, harm: dict[str, Any]) -> Score:
    """Judge one diagnosis; ``harm`` what the fault does to the identified body."""
    wanted = truth(scenario)
    names = tuple((finding.effect, finding.target) for finding in found.findings)
    sets = tuple(tuple((alias.effect, alias.target) for alias in finding.set) for finding in found.findings)
    exact = tuple(any(name in same for name in names) for same in wanted)
    within = tuple(any(same & set(some) for some in sets) for same in wanted)
    ratio, told = _ratio(scenario, found)
    error, covered = _size(scenario, found.findings, wanted[0]) if len(wanted) == 1 else (float("nan"), None)
    worst = found.adequacy[0] if found.adequacy else None
    return Score(
        scenario.key, group, scenario.level, scenario.subject, scenario.hidden,
        "cannot tell" if found.status == "cannot tell" else found.verdict, names, sets, exact, within, ratio, told,
        error, covered, (f"{worst.channel} {worst.band_hz[0]:g}-{worst.band_hz[1]:g} Hz", worst.z) if worst else ("",
        0.0), seconds,
        gain=harm | _gain(found.findings),
    )  # fmt: skip


def _ratio(scenario: Scenario, found: Diagnosis) -> tuple[float, float]:
    """Return the size of the only hidden cause over its limits in this session."""
    if len(scenario.hidden) != 1:
        return float("nan"), float("nan")
    same, size = truth(scenario)[0], _hidden_size(scenario.hidden[0])
    counts = MEASURED.get(parse_cause(scenario.hidden[0]).name)
    rows = [
        row
        for row in found.limits
        if _is_among((row.effect, row.target), same) and row.effect == (counts or row.effect)
    ]
    if not rows or size is None:
        return float("nan"), float("nan")
    return size[1] / min(row.limit for row in rows), size[1] / min(row.told_from for row in rows)


def _is_among(name: Name, same: set[Name]) -> bool:
    return name in same or (name[0], "") in same


def _hidden_size(text: str) -> tuple[str, float] | None:
    """Return name and size of the first parameter; a filter's is how far its cut-off lies under 10 Hz."""
    cause = parse_cause(text)
    if not cause.values:
        return None
    name, numbers = next(iter(cause.values.items()))
    return name, 10.0 - numbers[0] if cause.name == "filter_mismatch" else float(np.linalg.norm(numbers))


def _size(scenario: Scenario, findings: tuple[Finding, ...], same: set[Name]) -> tuple[float, bool | None]:
    """Return relative error of the size and whether the interval covers it, where the cause was named and has that
    parameter.
    """
    found = measured(scenario, findings, same)
    if found is None:
        return float("nan"), None
    value, sd, true = found
    return abs(value - true) / true, bool(abs(value - true) <= SIGMAS * sd)


def measured(scenario: Scenario, findings: tuple[Finding, ...], same: set[Name]) -> tuple[float, float, float] | None:
    """Return size found, its standard deviation and the true size; None where the cause was not named or has no such
    parameter.
    """
    size = _hidden_size(scenario.hidden[0])
    for finding in findings:
        if size is None or (finding.effect, finding.target) not in same or scenario.group == "discrete":
            continue
        name, true = size
        if finding.effect == "filter_mismatch":
            true = 10.0 - true
        parts = [p for p in finding.parameters if p.name == name or p.name.startswith(f"{name}_")]
        if parts:
            value = float(np.linalg.norm([p.value for p in parts]))
            sd = float(np.sqrt(sum((p.value * p.sd) ** 2 for p in parts)) / max(value, 1e-12))
            value = parts[0].value if len(parts) == 1 else value
            return value, sd, true
    return None


def _gain(findings: tuple[Finding, ...]) -> dict[str, Any]:
    if not findings or findings[0].gain is None:
        return {}
    one = findings[0].gain
    return {
        "before": list(map(float, one.rms_before)),
        "after": list(map(float, one.rms_after)),
        "ci95": list(map(float, one.ci95)),
    }


def stored(scenario: Scenario, run: str, *, absent: bool = False) -> Score | None:
    """Return the score of an earlier run, or None."""
    path = _path(scenario, run, absent)
    if not path.is_file():
        return None
    raw = json.loads(path.read_text())
    for key in ("names", "sets", "hidden", "exact", "within", "worst"):
        raw[key] = _tuples(raw[key])
    return Score(**raw)


def judged(scenario: Scenario, run: str, *, absent: bool = False) -> Score | None:
    """Return the score of a session in this ``run``, made now if it is not there; None where another process is making
    it.

    An error of any kind is a score that says so: one session never stops the others.
    """
    found, path = stored(scenario, run, absent=absent), _path(scenario, run, absent)
    if found is not None or not claimed(path):
        return found
    try:
        found = judge(scenario, absent=absent)
    except Exception as error:
        found = crashed(
            scenario, f"{type(error).__name__}: {error}"[:300], group="absent" if absent else scenario.group
        )
    finally:
        if found is not None:
            part = path.with_suffix(f".{os.getpid()}")
            part.write_text(json.dumps(asdict(found)))
            part.replace(path)
        path.with_suffix(".claim").unlink(missing_ok=True)
    return found


def crashed(scenario: Scenario, why: str, *, group: str) -> Score:
    """Return the score of a session that gave no answer."""
    nan, none = float("nan"), tuple(False for _ in scenario.hidden)
    return Score(
        scenario.key, group, scenario.level, scenario.subject, scenario.hidden, "crashed", (), (), none, none, nan,
        nan, nan, None,
        ("", 0.0), 0.0, note=why,
    )  # fmt: skip


def claimed(path: Path) -> bool:
    """Return whether this process may make the score at ``path``: the first to write its number beside it may, or
    one after it ended.
    """
    claim = path.with_suffix(".claim")
    claim.parent.mkdir(parents=True, exist_ok=True)
    try:
        with open(claim, "x") as stream:
            stream.write(str(os.getpid()))
    except FileExistsError:
        if _runs(claim):
            return False
        claim.write_text(str(os.getpid()))
    return True


def _runs(claim: Path) -> bool:
    """Return whether the process that wrote the claim still runs; one that has not written its number yet does."""
    try:
        os.kill(int(claim.read_text() or os.getpid()), 0)
    except (FileNotFoundError, ProcessLookupError):
        return False
    return True


def _path(scenario: Scenario, run: str, absent: bool) -> Path:
    return CACHE / f"scores-{run}" / f"{scenario.key}{'-absent' if absent else ''}.json"


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
