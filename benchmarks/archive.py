"""Go through an archive of thousands of sessions while processes are killed; print what was lost.

    BIODANCE_DATA=folder python -m benchmarks archive FOLDER --sessions 10000 [--dask] [--minutes M] [--kill-every S]

Sessions are real ones of three short trials, each with other noise, name and date. Fifty make a laboratory: from a date
on a fault is in all of them, one in ten has another fault, one in twenty is broken. Of two workers one is killed when
each has worked S seconds of processor time; one kill in ten is of the command itself or the scheduler. When a
laboratory is done, `biodance plates` is asked for its date, and its recordings become holes. Given again, it goes on.
"""

import argparse
import json
import os
import random
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import psutil
from inject import inject

from benchmarks.people import Row, kept
from benchmarks.plates import RECORDED
from benchmarks.walks import CHILDREN
from biodance.batch.run import LEDGER
from biodance.batch.summary import SESSIONS
from biodance.batch.work import OUTCOME
from biodance.errors import BiodanceError
from biodance.pipeline.learn import judge_plates
from biodance.virtual_lab.causes import fault_of, parse_cause
from biodance.virtual_lab.visit import Fault, Recording

VISITS, AHEAD = 50, 4
"""Sessions of a laboratory; laboratories that are written before the workers go through them."""
DAYS = [(date(2020, 1, 6) + timedelta(days=3 * visit)).isoformat() for visit in range(VISITS)]
QUANTITIES = dict(zip(RECORDED[1:], ("place_x", "place_y", "offset_x", "offset_z", "gain", "delay"), strict=True))
"""Faults, and what `biodance plates` calls the quantity that each changes."""
BATCH = (sys.executable, "-m", "biodance", "batch", "--no-pages", "--workers", "2")


class Laboratory:
    """Number ``number`` of an ``archive``: from visit ``at`` on, ``fault`` is in every session below ``folder``."""

    def __init__(self, archive: Path, number: int) -> None:
        self.folder, self.number = archive / f"lab{number:04d}", number
        self.fault = list(QUANTITIES)[number % len(QUANTITIES)]
        self.at = random.Random(number).randint(15, VISITS - 15)

    def write(self) -> None:
        """Write all sessions that are not there yet, each whole."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for visit in range(VISITS):
            with tempfile.TemporaryDirectory(dir=self.folder.parent.parent) as part:
                if not (place := self.folder / f"s{visit:02d}").exists():
                    self._write_session(Path(part, "new"), visit).rename(place)

    def _write_session(self, place: Path, visit: int) -> Path:
        place.mkdir()
        chance = random.Random(seed := VISITS * self.number + visit)
        source = Path(os.environ["BIODANCE_DATA"]) / CHILDREN[seed % len(CHILDREN)]
        texts = [self.fault] if visit >= self.at else []
        texts += [chance.choice(list(QUANTITIES))] if chance.random() < 0.1 else []
        for number, path in enumerate(sorted(source.glob("*.c3d"))):
            inject(path, place / path.name, altered(texts, 3 * seed + number))
        said = f'[subject]\nname = "P{seed}"\n[session]\ndate = {DAYS[visit]}\n'
        (place / "session.toml").write_text(said[int(chance.random() < 0.02) :])  # else without its first bracket
        for path in place.glob("*.c3d") if chance.random() < 0.03 else ():
            path.write_bytes(path.read_bytes()[: 600 + 100 * (seed % 7)])
        return place

    def finds(self) -> Row:
        """Return whether the date of the fault lies where the plates say that they changed, and what they say."""
        day, told = DAYS[self.at], list[tuple[str, str, str, str]]()
        with suppress(BiodanceError):
            changes = (one for card in judge_plates(self.folder).judgement.plates for one in card.changes)
            told = [(one.quantity, one.earliest.date, one.latest.date, one.plate) for one in changes if one.matters]
        found = any(what == QUANTITIES[self.fault] and first <= day <= last for what, first, last, _ in told)
        return {"lab": self.folder.name, "fault": self.fault, "date": day, "found": found, "told": told}

    def give_room_back(self) -> None:
        """Make holes of the recordings, with the sizes and times by which a session is known again."""
        for path in self.folder.glob("*/*.c3d"):
            known = path.stat()
            os.truncate(path, 0)
            os.truncate(path, known.st_size)
            os.utime(path, ns=(known.st_atime_ns, known.st_mtime_ns))


def altered(texts: list[str], seed: int) -> Fault:
    """Return a change of a recording: faults, 0.05 mm of noise in markers, 1e-4 of what plates read."""

    def change(one: Recording) -> Recording:
        chance = np.random.default_rng(seed)
        for text in texts if one.plates else ():
            one = fault_of(parse_cause(text), {one.name: (0.0, 1.0)})(one)
        plates = tuple(replace(p, channels=p.channels * chance.normal(1, 1e-4, p.channels.shape)) for p in one.plates)
        xyz = one.markers.xyz + chance.normal(0, 5e-5, one.markers.xyz.shape)
        return replace(one, markers=replace(one.markers, xyz=xyz), plates=plates)

    return change


def go_through(folder: Path, scheduler: str, every: float, until: float) -> Row:
    """Run the command over the archive below ``folder`` until its end, a kill of it, or until the time is over; return
    what was seen of its processes: processor time, memory MB of the command itself each minute, kills.
    """
    before, began, chance = finished(folder), time.monotonic(), random.Random()
    used, memory, killed, due = dict[int, float](), list[int](), Counter[str](), every
    command = [*BATCH, folder / "archive", "--out", folder / "results", *(["--scheduler", scheduler] * bool(scheduler))]
    with (folder / "said.txt").open("a") as said, cluster(scheduler) as served:
        client = psutil.Popen(command, stdout=said, stderr=said)
        while client.poll() is None:
            time.sleep(1.0)
            family = {one: (seconds, works) for one, seconds, works in processes([client, *served])}
            used |= {one.pid: seconds for one, (seconds, _) in family.items()}
            with suppress(psutil.Error):
                memory += [client.memory_info().rss >> 20] * (time.monotonic() - began > 60 * len(memory))
            if time.monotonic() > until:
                client.kill()
            elif (worked := sum(used.values()) / 2) > due and (
                workers := [one for one, (_, works) in family.items() if works]
            ):
                others = [("command", client), *(("scheduler", one) for one in served[:1])]
                kind, victim = chance.choice(others) if chance.random() < 0.1 else ("worker", chance.choice(workers))
                with suppress(psutil.Error):
                    victim.kill()
                    killed[kind], due = killed[kind] + 1, worked + every
    after, there = finished(folder), len(list((folder / "archive").glob("*/s*")))
    return {
        "end": client.returncode, "dask": bool(scheduler), "killed": killed, "memory_mb": memory,
        "finished": len(after) - len(before), "again": sum(after.get(name) != at for name, at in before.items()),
        "wall_s": round(time.monotonic() - began), "processor_s": round(sum(used.values())),
        "lost": there - len(after) if client.returncode in (0, 1) else 0,
    }  # fmt: skip


@contextmanager
def cluster(address: str) -> Iterator[list[psutil.Popen]]:
    """Start a Dask scheduler at an address, and two workers; yield both, nothing without an address."""
    words = f"scheduler --port {address.rpartition(':')[2]}", f"worker {address} --nworkers 2 --nthreads 1"
    served = list[psutil.Popen]()
    with ExitStack() as stack:
        for one in words if address else ():
            command = f"{sys.executable} -m distributed.cli.dask_{one} --no-dashboard".split()
            served.append(stack.enter_context(psutil.Popen(command, stderr=subprocess.DEVNULL)))
            stack.callback(served[-1].terminate)
        time.sleep(10 * len(served))
        yield served


def processes(roots: list[psutil.Popen]) -> Iterator[tuple[psutil.Process, float, bool]]:
    """Yield all processes below ``roots`` with their processor time, s, and whether sessions are worked on in them."""
    for root in roots:
        with suppress(psutil.Error):
            for one in (root, *root.children(recursive=True)):
                with suppress(psutil.Error):
                    forked = any(word in " ".join(one.cmdline()) for word in ("forkserver", "spawn_main"))
                    yield one, sum(one.cpu_times()[:2]), forked and not one.children()


def finished(folder: Path) -> dict[str, int]:
    """Return when each session was finished."""
    found = (folder / "results" / SESSIONS).glob(f"[!.]*/{OUTCOME}")
    return {path.parent.name: path.stat().st_mtime_ns for path in found}


def table(folder: Path) -> None:
    """Print what came out so far."""
    runs = [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]
    labs = [json.loads(path.read_text()) for path in sorted(folder.glob("lab*.json"))]
    with closing(sqlite3.connect(folder / "results" / LEDGER)) as book:
        rows = book.execute("SELECT status, reason, times FROM sessions").fetchall()
    wall, hours, done = (sum(run[name] for run in runs) for name in ("wall_s", "processor_s", "finished"))
    wall, hours, memory = wall / 3600, hours / 3600, [mb for run in runs for mb in run["memory_mb"][2:] if mb] or [0]
    told = {
        "sessions with an outcome; in the ledger": f"{len(finished(folder))}; {len(rows)}",
        "lost in runs that came to their end": max(run["lost"] for run in runs),
        "written down twice; done again": f"{sum(n > 1 for *_, n in rows)}; {sum(run['again'] for run in runs)}",
        "status": dict(Counter(status for status, *_ in rows)),
        "not done, without a reason": sum(status != "done" and not why for status, why, _ in rows),
        "killed": dict(sum((Counter(run["killed"]) for run in runs), Counter())),
        "command, MB: first, median, last, most": [memory[0], np.median(memory), memory[-1], max(memory)],
        "hours; of processor; sessions in one of these": f"{wall:.2f}; {hours:.2f}; {done / max(hours, 1e-9):.0f}",
        "dates found": f"{sum(lab['found'] for lab in labs)} of {len(labs)}",
        "not found": [lab for lab in labs if not lab["found"]],
    }
    print("\n".join(f"| {name} | {value} |" for name, value in told.items()))


def main() -> None:
    """Write laboratories, go through them, ask for their dates; print what came out."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--dask", action="store_true")
    for option, usual in (("--sessions", 10_000), ("--minutes", 60), ("--kill-every", 60)):
        ask.add_argument(option, type=int, default=usual)
    asked = ask.parse_args()
    folder, until = asked.folder.resolve(), time.monotonic() + 60 * asked.minutes
    labs = [Laboratory(folder / "archive", number) for number in range(-(-asked.sessions // VISITS))]
    labs = [lab for lab in labs if not folder.joinpath(f"{lab.folder.name}.json").exists()]
    while time.monotonic() < until and labs:
        for lab in labs[:AHEAD]:
            lab.write()
        row = go_through(folder, "tcp://127.0.0.1:18786" * asked.dask, asked.kill_every, until)
        with (folder / "runs.jsonl").open("a") as log:
            log.write(json.dumps(row) + "\n")
        while row["end"] in (0, 1) and labs and labs[0].folder.exists():
            kept(folder / f"{labs[0].folder.name}.json", labs[0].finds)
            labs.pop(0).give_room_back()
    table(folder)
