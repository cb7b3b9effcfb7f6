"""Is anything silent: every effect at 1, 3 and 10 times the limit that the diagnosis of that very session gives it.

    python benchmarks/bench_limits.py [--null 1] [--trials 4] [--effects NAME ...] [--out docs/benchmarks/diagnosis.md]

One session of the own laboratory without fault (`hidden_causes.nulls`, tracked once and kept: `hidden_sessions.CACHE`).
A cause of plates, clocks, loads and touches is written into what its plates measured, a wrong geometry into the body
that is held against it: each as its effect has it, at the target that this session sees best. Silent is "nothing
wrong" where the page gives a limit below that size.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from hidden_causes import nulls
from hidden_sessions import CACHE, examined

from biodance.body.body import Body
from biodance.diagnosis.diagnosis import Unobservable
from biodance.diagnosis.engine import Examined, diagnose_trials
from biodance.diagnosis.problem import TrialWindow
from biodance.effects import Case, Effect
from biodance.pipeline.judged_trials import cases_of, chosen_windows
from biodance.records import Array

TIMES = (1.0, 3.0, 10.0)
_CLOCKS = ("time_delay", "clock_drift")
START, END = "<!-- limits: begin -->", "<!-- limits: end -->"


@dataclass(frozen=True)
class Told:
    """What one session was told: the effect and target ``hidden`` in it at so many ``times`` the ``limit`` (``unit``),
    the ``verdict`` and what was ``named``.
    """

    hidden: str
    limit: float
    unit: str
    times: float
    verdict: str
    named: tuple[str, ...]

    @property
    def silent(self) -> bool:
        """Whether nothing is said to be wrong."""
        return self.verdict == "nothing wrong"


def best_seen(clean: Examined) -> Iterator[tuple[Effect, Unobservable]]:
    """Yield of every effect the target with the smallest limit, in typical sizes, and its row; those without a limit
    are what the page calls unseen.
    """
    best: dict[str, Unobservable] = {}
    for row in clean.diagnosis.limits:
        if np.isfinite(row.limit) and row.limit / row.typical < _share(best.get(row.effect)):
            best[row.effect] = row
    for one in clean.naming.first_causes:
        row = best.get(one.names[0])
        if row and (row.effect, row.target) == one.names:
            yield one.effect, row


def _share(row: Unobservable | None) -> float:
    return row.limit / row.typical if row else float("inf")


def size(effect: Effect, row: Unobservable, times: float) -> Array:
    """Return the parameters of an effect at so many times its limit, the first parameter as it is told."""
    wanted, theta = times * row.limit, np.zeros(effect.typical.size)
    tried = np.geomspace(1e-3, 1e4, 20_000) * effect.typical[0]
    told = np.array([effect.reported_size(one) for one in tried])
    theta[0] = tried[int(np.argmin(np.abs(told - min(wanted, 0.8 * effect.reported_size(float("inf"))))))]
    return theta


def with_hidden(
    cases: tuple[Case, ...], windows: tuple[TrialWindow, ...], effect: Effect, theta: Array
) -> tuple[TrialWindow, ...]:
    """Return the trials with a cause in what was measured, or held against a body with its geometry wrong."""
    if effect.taken_up_by_calibration:
        return tuple(
            replace(window, motion=effect.corrected(case, -theta).motion)
            for case, window in zip(cases, windows, strict=True)
        )
    return tuple(
        replace(window, trial=_faulty(case, effect, theta).trial) for case, window in zip(cases, windows, strict=True)
    )


def _faulty(case: Case, effect: Effect, theta: Array) -> Case:
    """Return the case with a cause in it; clocks move all that was measured, not only what the table's body needs."""
    if effect.name in _CLOCKS:
        return case.with_added(effect.plate_of(case), -effect.removed(case, -theta))
    return effect.transform(case, theta)


def held(body: Body, cases: tuple[Case, ...], effect: Effect, theta: Array) -> Body:
    """Return the body that the trials are held against."""
    return effect.corrected(cases[0], -theta).body if effect.taken_up_by_calibration else body


def asked(number: int, trials: int) -> tuple[Body, tuple[TrialWindow, ...]]:
    """Return body and trials of a session without fault."""
    result = examined(nulls()[number])
    assert result.body is not None
    return result.body, chosen_windows(result.trials)[:trials]


def table(found: list[Told]) -> list[str]:
    """Return the page's rows: one for each effect, and the count."""
    lines = ["| effect, target | its limit here | at 1 x | 3 x | 10 x |", "|---|---|---|---|---|"]
    for hidden in dict.fromkeys(one.hidden for one in found):
        rows = {one.times: one for one in found if one.hidden == hidden}
        first = next(iter(rows.values()))
        said = [_said(rows[times]) if times in rows else "" for times in TIMES]
        lines.append(f"| {hidden} | {first.limit:.3g} {first.unit} | {' | '.join(said)} |")
    large = [one for one in found if one.times >= 3]
    lines += ["", f"Silent at 3 limits or more: {sum(one.silent for one in large)} of {len(large)}."]
    return lines


def _said(one: Told) -> str:
    if not one.named:
        return one.verdict
    return "named" if one.named[0] == one.hidden and len(one.named) == 1 else "named: " + ", ".join(one.named)


def main() -> None:
    """Hide every effect at every size and print what was said."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--null", type=int, default=1)
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--effects", nargs="*", default=[])
    parser.add_argument("--times", nargs="*", type=float, default=TIMES)
    parser.add_argument("--run", default="now", help="what is there of this run is not made again")
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    kept = CACHE / f"limits-{chosen.run}.jsonl"
    rows = kept.read_text().splitlines() if kept.is_file() else []
    found = [Told(**json.loads(row) | {"named": tuple(json.loads(row)["named"])}) for row in rows]
    body, windows = asked(chosen.null, chosen.trials)
    clean = diagnose_trials(body, windows)
    print("clean:", clean.diagnosis.told, flush=True)
    cases = cases_of(body, windows)
    for effect, row in best_seen(clean):
        hidden = f"{effect.name} {effect.target}".strip()
        for times in chosen.times:
            known = any((one.hidden, one.times) == (hidden, times) for one in found)
            if known or (chosen.effects and effect.name not in chosen.effects):
                continue
            theta = size(effect, row, times)
            one = diagnose_trials(
                held(body, cases, effect, theta), with_hidden(cases, windows, effect, theta)
            ).diagnosis
            names = tuple(f"{f.effect} {f.target}".strip() for f in one.findings)
            found.append(Told(hidden, row.limit, row.unit, times, one.verdict, names))
            with kept.open("a") as stream:
                stream.write(json.dumps(vars(found[-1])) + "\n")
            print(found[-1], flush=True)
    print(*table(found), sep="\n")
    if chosen.out:
        head, _, rest = chosen.out.read_text().partition(START)
        part = "\n".join([START, *table(found), END])
        chosen.out.write_text(f"{head.rstrip()}\n\n{part}{rest.partition(END)[2] if rest else chr(10)}")


if __name__ == "__main__":
    main()
