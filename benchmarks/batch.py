"""Send an archive of a thousand sessions through `biodance batch` while its processes are killed; print what came out.

    BIODANCE_DATA=folder python -m benchmarks batch [--sessions 1000] [--workers 2]

Plate-only recordings (data/bds), real sessions with markers, repeated as links, and one in twenty broken.
One process of the workers is killed for every 30 s of processor time (twice a minute on an idle core); at 40 % the
command itself. Budget: 300 s of processor time.
"""

import argparse
import contextlib
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from biodance.batch.outcome import OUTCOME
from biodance.batch.run import LEDGER

DATA = Path(os.environ.get("BIODANCE_DATA", "")).resolve()
REAL = (*(f"biomechzoo/HC0{n}A" for n in (30, 31, 32, 38, 44, 50, 55)), "adl_gait", "pycgm", "c3d_parser_Sydney",
        "c3d_parser_QCMAS")  # fmt: skip
DESCRIBED = """columns = ["time_s", "Fx", "Fy", "Fz", "Mx", "My", "Mz", "skip", "skip"]
force_unit = "N"
moment_unit = "Nm"
rate_hz = 100
plate_size_m = [0.4, 0.6]
sensor_depth_m = 0.0
acts_on = "subject"
"""
KINDS = {"plates": 0.88, "real": 0.07, "broken": 0.05}
"""Share of each kind of session."""


def build(archive: Path, count: int) -> Counter[str]:
    """Write an archive of ``count`` sessions, kinds mixed by name; return how many there are of each kind."""
    people = pd.read_csv(DATA / "bds" / "trials.csv")
    makers = {
        "plates": lambda folder, k: plates_only(folder, people.iloc[k % len(people)]),
        "real": real_session,
        "broken": broken,
    }
    kinds = [kind for kind, share in KINDS.items() for _ in range(round(share * count))]
    random.Random(0).shuffle(kinds)
    made: Counter[str] = Counter()
    for k, kind in enumerate(kinds):
        folder = archive / f"s{k:04d}_{kind}"
        folder.mkdir(parents=True)
        makers[kind](folder, made[kind])
        made[kind] += 1
    return made


def plates_only(folder: Path, row: pd.Series) -> None:
    """Link one recording of somebody who stands on a plate, and describe it."""
    (folder / f"{row.trial}.txt").symlink_to(DATA / "bds" / f"{row.trial}.txt")
    (folder / f"{row.trial}.toml").write_text(DESCRIBED)
    said = {"mass_kg": row.weight_kg, "height_m": row.height_cm / 100, "sex": f'"{row.sex}"', "age": row.age_yr}
    lines = ["[subject]", *(f"{key} = {value}" for key, value in said.items()), ""]
    (folder / "session.toml").write_text("\n".join(lines))


def real_session(folder: Path, k: int) -> None:
    """Link a real session once whole, then its static trial again and again."""
    source = DATA / REAL[k % len(REAL)]
    files = sorted(path for path in source.iterdir() if path.suffix.lower() in {".c3d", ".toml", ".enf", ".mp"})
    whole = k < len(REAL)
    for path in files if whole else [files[0], *(one for one in files[1:] if one.suffix.lower() != ".c3d")]:
        (folder / path.name).symlink_to(path)


def broken(folder: Path, k: int) -> None:
    """Write a session that cannot be used, one of ten ways."""
    walk = (DATA / "biomechzoo" / "HC030A" / "HC030A05.c3d").read_bytes()
    table = (DATA / "bds" / "BDS00001.txt").read_text()
    ways = (
        ("walk.c3d", b""),
        ("walk.c3d", b"time,Fx,Fy\n1,2,3\n" * 200),
        ("walk.c3d", walk[: len(walk) // 3]),
        ("walk.c3d", random.Random(k).randbytes(20_000)),
        ("walk.c3d", walk[:2] + random.Random(k).randbytes(510) + walk[512:]),
        ("walk.c3d", walk[:512] + random.Random(k).randbytes(4096) + walk[4608:]),
        ("session.toml", b"[subject]\nmass = 70\n"),
        ("session.toml", b"[subject\n"),
        ("BDS00001.txt", table.encode()),
        ("BDS00001.txt", table.replace("539", "nan").encode()),
    )
    name, content = ways[k % len(ways)]
    (folder / name).write_bytes(content)
    if name == "session.toml":
        (folder / "walk.c3d").symlink_to(DATA / "biomechzoo" / "HC030A" / "HC030A05.c3d")
    if k % len(ways) == 9:
        (folder / "BDS00001.toml").write_text(DESCRIBED)


@dataclass
class Watch:
    """What was seen of the processes below this one, once a second: the processor time s of each, and the kills, one
    for ``every`` s of processor time.
    """

    every: float
    killed: int = 0
    processor: dict[int, float] = field(default_factory=dict)
    over: threading.Event = field(default_factory=threading.Event)

    @property
    def seconds(self) -> float:
        """Processor time of all, s."""
        return sum(self.processor.values())

    def follow(self) -> None:
        """Look once a second, and kill."""
        chance, due = random.Random(1), self.every
        while not self.over.wait(1.0):
            family = descendants(os.getpid())
            self.processor.update({one: processor_time(one) or self.processor.get(one, 0.0) for one in family})
            victims = [one for one in family if not descendants(one) and works(one)]
            if self.seconds > due and victims:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(chance.choice(victims), signal.SIGKILL)
                    self.killed += 1
                due = self.seconds + self.every


def descendants(parent: int) -> list[int]:
    """Return the processes below one."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(path.read_text().rsplit(")", 1)[1].split()[1]) == parent:
                found += [int(path.parent.name), *descendants(int(path.parent.name))]
    return found


def works(process: int) -> bool:
    """Return whether a process is one that sessions are worked on in (no tracker of resources)."""
    with contextlib.suppress(OSError):
        told = Path(f"/proc/{process}/cmdline").read_bytes()
        return b"forkserver" in told or b"spawn_main" in told
    return False


def processor_time(process: int) -> float:
    """Return the processor time of a process, s."""
    with contextlib.suppress(OSError):
        told = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def finished(out: Path) -> dict[str, float]:
    """Return when each session was finished."""
    return {path.parent.name: path.stat().st_mtime for path in (out / "sessions").glob(f"*/{OUTCOME}")}


@contextlib.contextmanager
def watched(command: list[str], every: float) -> Iterator[tuple[subprocess.Popen[bytes], Watch]]:
    """Start a command whose processes are killed, and watch it until it is over."""
    client = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    watch = Watch(every)
    thread = threading.Thread(target=watch.follow)
    thread.start()
    try:
        yield client, watch
    finally:
        watch.over.set()
        thread.join()


def go_through(archive: Path, out: Path, options: list[str], count: int, every: float) -> dict[str, object]:
    """Go through an archive: the command is killed at 40 %, given again to the end, and again; return what was seen."""
    command = [sys.executable, "-m", "biodance", "batch", str(archive), "--out", str(out), *options]
    began = time.monotonic()
    with watched(command, every) as (client, first):
        while client.poll() is None and len(finished(out)) < 0.4 * count:
            time.sleep(0.5)
        client.kill()
        client.wait()
    before = finished(out)
    with watched(command, every) as (client, second):
        client.wait()
    took = time.monotonic() - began
    after, again = finished(out), time.monotonic()
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    with closing(sqlite3.connect(out / LEDGER)) as book:
        rows = book.execute("SELECT status, times FROM sessions").fetchall()
    return {
        "sessions": count,
        "in the ledger": len(rows),
        "written down twice": sum(times > 1 for _, times in rows),
        "status": dict(Counter(status for status, _ in rows)),
        "workers killed": first.killed + second.killed,
        "command killed at": len(before),
        "gone through again after that": sum(after[name] != before[name] for name in before),
        "changed by a third call": sum(finished(out)[name] != after[name] for name in after),
        "third call, s": round(time.monotonic() - again, 1),
        "wall time, s": round(took),
        "processor time, s": round(first.seconds + second.seconds),
    }


def main() -> None:
    """Build, go through, print."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--sessions", type=int, default=1000)
    ask.add_argument("--workers", type=int, default=2)
    ask.add_argument("--every", type=float, default=30.0, help="s of processor time between two kills")
    asked = ask.parse_args()
    with tempfile.TemporaryDirectory() as place:
        archive, out = Path(place, "archive").resolve(), Path(place, "results")
        made = build(archive, asked.sessions)
        print(dict(made), flush=True)
        seen = go_through(archive, out, ["--workers", str(asked.workers)], sum(made.values()), asked.every)
        for name, value in seen.items():
            print(f"| {name} | {value} |")
