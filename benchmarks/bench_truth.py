"""The truth in any laboratory: every demand on a diagnosis in one table, real, foreign, own and drawn laboratories
apart.

    BIODANCE_DATA=folder BIODANCE_FOREIGN_LAB=folder PYTHONPATH=tests python benchmarks/bench_truth.py --run NAME
        [--part clean removed ...] [--column real own ...] [--first N] [--minutes M]

All parts are run in turn; each session or archive is run once and kept (`hidden_sessions.CACHE`, a line of
truth-NAME.jsonl), so that a run that was stopped goes on, and the table is printed from all that is there. Sessions of
a part come in an order in which every beginning is a sample of the whole: ``--first`` runs only so many of each part,
``--minutes`` ends the run early (0: only the table). A part whose data are not there (BIODANCE_DATA: real recordings,
BIODANCE_FOREIGN_LAB: the simulator that is not ours) says so and is left out.
"""

import argparse
import json
import os
import time
from collections import defaultdict
from collections.abc import Sequence
from itertools import islice
from typing import Any

import truth_parts
from hidden_sessions import CACHE
from truth_parts import Job

PARTS = ("clean", "walks", "removed", "own_faults", "loads", "plates", "registration")
COLUMNS = {"real": "BIODANCE_DATA", "foreign": "BIODANCE_FOREIGN_LAB", "own": "PATH", "family": "PATH"}
"""Column -> variable of the environment without which it is left out."""
BARS = {
    "without fault: a false name or an alarm": "<= 5 % real, 3 % own",
    "without fault, real rooms: a false name or an alarm": "<= 5 %",
    "without fault, as quiet as here: a false name or an alarm": "<= 5 %",
    "without fault, as it comes: a false name or an alarm": "<= 10 %",
    '"complete" or "nothing wrong" beside a failed check': "never",
    "walks with a fault: named or in the set": ">= 90 %",
    "walks with a fault: interval covers": ">= 90 %",
    "walks with a fault: refused": "never",
    "a clear fault: not nothing wrong": ">= 95 %",
    "a clear fault: named": ">= 85 %",
    "a clear fault: an innocent named": "<= 10 %",
    "a clear fault: interval covers": ">= 90 %",
    "no file describes it: unexplained": ">= 90 %",
    "one file removed: an innocent named": "<= 10 %",
    "one file removed: ... and called complete": "never",
    "twice its limit or more: detected": ">= 97 %",
    "twice its limit or more: named": ">= 96 %",
    "twice its limit or more: interval covers": ">= 90 %",
    "unloaded, no reference: a load found": "never",
    "2.4 kg with reference: within 0.25 kg": "all",
    "2.4 kg with reference: interval covers": ">= 90 %",
    "plates: 5 mm within 5 visits, date right": "found",
    "plates: 5 N within 2 visits, date right": "found",
    "plates: the pad named, of persons": ">= 6 of 7",
    "plates without a step: an alarm": "none in walks",
    "registration: within all bars, or refused": ">= 95 %",
}
"""Demand -> bar."""


def spread(jobs: Sequence[Job], step: int = 7) -> list[Job]:
    """Return jobs in an order in which every beginning is a sample of the whole."""
    return [one for k in range(step) for one in jobs[k::step]]


def possible(part: str, columns: Sequence[str]) -> list[Job]:
    """Return the jobs of a part in some columns whose data are there."""
    jobs = [one for one in getattr(truth_parts, part)() if one.column in columns]
    missing = sorted({COLUMNS[one.column] for one in jobs} - set(os.environ))
    if missing:
        print(f"{part}: left out what needs {', '.join(missing)}.")
    return [one for one in jobs if COLUMNS[one.column] not in missing]


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the demands as a table: how often, of how many, in each kind of laboratory."""
    counts: dict[str, dict[str, list[bool]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        for demand, hits in row["hits"].items():
            counts[demand][row["column"]] += hits
    lines = ["| demand | bar | real | foreign | own | drawn |", "|---|---|---|---|---|---|"]
    for demand in (*BARS, *(other for other in counts if other not in BARS)):
        if counts[demand]:
            cells = [_share(counts[demand][column]) for column in COLUMNS]
            lines.append(f"| {demand} | {BARS.get(demand, '')} | {' | '.join(cells)} |")
    return lines


def _share(hits: Sequence[bool]) -> str:
    return f"{sum(hits)} of {len(hits)} ({100 * sum(hits) / len(hits):.0f} %)" if hits else "-"


def main() -> None:
    """Run what is not there yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", required=True)
    parser.add_argument("--part", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--column", nargs="+", choices=COLUMNS, default=tuple(COLUMNS))
    parser.add_argument("--first", type=int, help="sessions of each part")
    parser.add_argument("--minutes", type=float, default=1e9)
    asked = parser.parse_args()
    path, start = CACHE / f"truth-{asked.run}.jsonl", time.monotonic()
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []
    known = {(row["part"], row["column"], row["key"]) for row in rows}
    for part in asked.part:
        for job in islice(spread(possible(part, asked.column)), asked.first):
            if (job.part, job.column, job.key) in known or time.monotonic() - start >= 60 * asked.minutes:
                continue
            said, hits = job.run()
            rows.append({"part": job.part, "column": job.column, "key": job.key, "said": said, "hits": hits})
            with path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(rows[-1], default=bool) + "\n")
            print(f"{job.part}, {job.column}, {job.key}: {said}", flush=True)
    print(*table(rows), sep="\n")


if __name__ == "__main__":
    main()
