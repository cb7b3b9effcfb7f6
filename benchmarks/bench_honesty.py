"""No false certainty: real recordings, a foreign virtual laboratory and the own one, diagnosed and held against what a
verdict may say.

    BIODANCE_DATA=folder BIODANCE_FOREIGN_LAB=folder python benchmarks/bench_honesty.py --run NAME [--only real foreign
        own] [--foreign 24] [--out docs/benchmarks/diagnosis.md]

Sessions are tracked once and kept (`hidden_sessions.CACHE`), answers are kept per ``--run``: a run that was stopped
goes on. ``--out`` writes the columns real, foreign and own of the runs ``before`` and NAME into that page.
"""

import argparse
import json
import re
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from hidden_sessions import CACHE
from honesty_sessions import ROOM, jobs

from biodance.diagnosis.diagnosis import Finding
from biodance.errors import BiodanceError
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.results import SessionResult

START, END = "<!-- honesty: begin -->", "<!-- honesty: end -->"


@dataclass(frozen=True)
class Answer:
    """What one session was told: ``column`` real, foreign or own; ``names`` found, ``false`` of them not true; the
    ``headline``; ``failed`` checks and ``missed`` trials; ``hidden`` the true cause.
    """

    key: str
    column: str
    verdict: str
    names: tuple[str, ...]
    false: tuple[str, ...]
    headline: str
    failed: int
    missed: int
    worst: str
    z: float
    hidden: str = ""
    seconds: float = 0.0
    said: tuple[str, ...] = ()
    covers: bool | None = None

    @property
    def alarm(self) -> bool:
        """Whether a session without fault is called wrong."""
        return not self.hidden and (bool(self.false) or (self.verdict != "nothing wrong" and not self.cannot_tell))

    @property
    def cannot_tell(self) -> bool:
        """Whether the session says that it cannot tell."""
        return self.headline.startswith("Nobody can tell")

    @property
    def contradicts(self) -> bool:
        """Whether "nothing wrong" or "complete" stands beside a failed check or an unjudged trial without a word."""
        if not (self.failed or self.missed):
            return False
        bare = self.verdict == "nothing wrong" and ", but " not in self.headline
        return self.verdict == "named, complete" or bare


def answered(key: str, column: str, result: SessionResult, true: set[str], hidden: str = "") -> Answer:
    """Diagnose a session and say what it was told; ``true`` names are not false."""
    start = time.process_time()
    failed = sum(not check.inside for check in result.all_checks)
    fits = [trial for trial in result.trials if trial.trial.role == "fit"]
    missed = len(result.session.refused) + sum(
        one.motion is None or one.comparison is None or not one.comparison.used.any() for one in fits
    )
    try:
        found = diagnose_session(result)
    except BiodanceError as error:
        return Answer(key, column, "refused", (), (), str(error), failed, missed, "", 0.0, hidden)
    one = found.diagnosis
    missed = sum(judged.missed for judged in one.judged) if hasattr(one, "judged") else missed
    names = tuple(f"{finding.effect} {finding.target}".strip() for finding in one.findings)
    false = tuple(name for name in names if name.split()[0] not in true and name not in true)
    head = next((said.text for said in getattr(one, "attention", ()) if said.about == "diagnosis"), one.told)
    worst = one.adequacy[0] if one.adequacy else None
    where = f"{worst.channel} {worst.band_hz[0]:g}-{worst.band_hz[1]:g} Hz" if worst else ""
    seconds = time.process_time() - start
    z = worst.z if worst else 0.0
    said = (*map(repr, one.findings), *(f"resembles {other!r}" for other in one.resembles), *one.notes)
    return Answer(
        key,
        column,
        one.verdict,
        names,
        false,
        head,
        failed,
        missed,
        where,
        z,
        hidden,
        seconds,
        said,
        _covers(hidden, one.findings),
    )


def _covers(hidden: str, findings: tuple[Finding, ...]) -> bool | None:
    """Return whether the 95 % interval of the first size holds what was hidden; None where it was not named."""
    effect, _, rest = hidden.partition(":")
    target = rest.partition("target=")[2].partition(",")[0]
    found = [one for one in findings if (one.effect, one.target) == (effect, target) and one.parameters]
    if not found:
        return None
    low, high = found[0].parameters[0].interval
    return bool(low <= float(rest.rpartition("=")[2]) <= high)


def run(name: str, only: list[str], match: str, *, foreign: int, own: int, family: int) -> list[Answer]:
    """Return the answers of a run; those that are there are not made again."""
    path = CACHE / "honesty" / f"answers-{name}.json"
    known = {row["key"]: row for row in json.loads(path.read_text())} if path.is_file() else {}
    for key, column, get, true, hidden in jobs(foreign, own, family):
        if key not in known and re.search(match, key) and (not only or any(column.startswith(one) for one in only)):
            known[key] = asdict(answered(key, column, get(), true, hidden))  # type: ignore[operator]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(list(known.values()), indent=1))
            one = known[key]
            print(
                f"{key}: {one['verdict']} {one['names']} {one['worst']} z {one['z']:.1f} | {one['headline']}",
                flush=True,
            )
    return [Answer(**{k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}) for row in known.values()]


def table(before: list[Answer], now: list[Answer]) -> list[str]:
    """Return the page's part: counts before and now in the columns real, foreign and own, then every session."""

    def cell(test, column: str) -> str:  # type: ignore[no-untyped-def]
        counts = []
        for some in (before, now):
            here = [one for one in some if one.column == column and test(one) is not None]
            counts.append(f"{sum(map(test, here))} of {len(here)}" if here else "-")
        return " -> ".join(counts)

    tests = {
        "clean session: a false name": lambda one: None if one.hidden else bool(one.false),
        "clean session: a false name or alarm": lambda one: None if one.hidden else one.alarm,
        "clean session: says that it cannot tell, or was refused": (
            lambda one: None if one.hidden else one.cannot_tell or one.verdict == "refused"
        ),
        '"nothing wrong" or "complete" beside a failed check or an unjudged trial, without a word': (
            lambda one: one.contradicts
        ),
        "hidden fault: named, and nothing else": (
            lambda one: bool(one.names) and not one.false if one.hidden else None
        ),
    }  # fmt: skip
    lines = [
        "## No more than the evidence carries",
        "",
        "Real recordings without a known fault, clean sessions of an independent virtual laboratory "
        f"({' '.join(ROOM)}), and this project's own one; before -> now. Made by `benchmarks/bench_honesty.py`.",
        "",
        "| | real | foreign | own |",
        "|---|---|---|---|",
        *(
            f"| {name} | {' | '.join(cell(test, c) for c in ('real', 'foreign', 'own'))} |"
            for name, test in tests.items()
        ),
        "",
        "| session | before | now |",
        "|---|---|---|",
    ]
    old = {one.key: one for one in before}
    return lines + [f"| {one.key} | {_said(old.get(one.key))} | {_said(one)} |" for one in now]


def _said(one: Answer | None) -> str:
    if one is None:
        return "-"
    names = f": {', '.join(one.names)}" if one.names else ""
    return f"{'cannot tell' if one.cannot_tell else one.verdict}{names}"


def main() -> None:
    """Diagnose what is asked for and write the page's part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", default="now")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--match", default="", help="regular expression that a session's key must have in it")
    parser.add_argument("--foreign", type=int, default=24)
    parser.add_argument("--own", type=int, default=12)
    parser.add_argument("--family", type=int, default=12)
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    answers = run(chosen.run, chosen.only, chosen.match, foreign=chosen.foreign, own=chosen.own, family=chosen.family)
    if chosen.out:
        path = CACHE / "honesty" / "answers-before.json"
        rows = json.loads(path.read_text()) if path.is_file() else []
        before = [Answer(**{k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}) for row in rows]
        text = chosen.out.read_text()
        head, _, rest = text.partition(START)
        part = "\n".join([START, *table(before, answers), END])
        tail = rest.partition(END)[2] if rest else "\n"
        chosen.out.write_text(f"{head.rstrip()}\n\n{part}{tail}")


if __name__ == "__main__":
    main()
