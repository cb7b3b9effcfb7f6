"""Break important lines one at a time and see whether the tests notice: a mutant that no test kills is a line that
nobody guards.

    python tests/mutants.py [NAME ...] [--jobs 1] [--out build/mutants] [--again]

The mutants stand in `tests/mutants.toml`: the exact snippet of one file, what it becomes, the tests that must
fail. Each job works in its own temporary copy of the checkout, which itself is never touched. The named tests are run
unbroken first (those that fail there kill nothing), then once per mutant, stopped by the first failure. Results are
kept in ``--out``, so that a run that was interrupted goes on where it stopped; a mutant whose entry, file or tests have
changed since is run again. Exit code 1 when one survives.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Literal

CHECKOUT = Path(__file__).resolve().parents[1]
TABLE = CHECKOUT / "tests" / "mutants.toml"
SAFETY_SECONDS = 10.0
"""s, start of Python included, within which a mutant of the safety of dances must be killed."""
PATIENCE = 600.0
"""s after which the tests of a mutant are given up."""
NOT_COPIED = (".git", ".venv", "node_modules", "build", "demo", "__pycache__", ".*_cache", "*.egg-info")
FAILED, ERRORS, ALL_PASSED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE), (2, 3, 4, 5), 0


@dataclass(frozen=True)
class Mutant:
    """One broken line: in ``file`` the only occurrence of ``old`` becomes ``new``; ``tests`` (pytest's addresses) must
    notice; ``safety`` whether people could fall; ``why`` the line matters.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    why: str
    safety: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: ``by`` the first test that failed, ``seconds`` until then; ``of`` what was run."""

    name: str
    fate: Literal["killed", "survived", "broken run"]
    by: str
    seconds: float
    of: str


def read_mutants(table: Path = TABLE) -> tuple[Mutant, ...]:
    """Return all mutants of the table, in its order."""
    found = tomllib.loads(table.read_text(encoding="utf-8"))
    return tuple(Mutant(name=name, **one | {"tests": tuple(one["tests"])}) for name, one in found.items())


def broken_text(mutant: Mutant, text: str) -> str:
    """Return the ``text`` of the mutant's file with its line broken.

    Raises
    ------
    ValueError
        The snippet does not occur exactly once, or nothing changes.
    """
    count = text.count(mutant.old)
    if count != 1 or mutant.old == mutant.new:
        raise ValueError(
            f"mutant {mutant.name}: its snippet occurs {count} times in {mutant.file}, must be once and must change. "
            "Correct tests/mutants.toml."
        )
    return text.replace(mutant.old, mutant.new)


def fingerprint(mutant: Mutant) -> str:
    """Return a digest of the entry, its file and its tests: where it is the same, a result still holds."""
    files = (mutant.file, *dict.fromkeys(test.split("::")[0] for test in mutant.tests))
    content = b"".join((CHECKOUT / file).read_bytes() for file in files)
    return hashlib.sha256(repr(mutant).encode() + content).hexdigest()[:16]


def copied_checkout(folder: Path) -> Path:
    """Return a copy of the checkout in ``folder``, compiled so that a changed file is seen by its content."""
    copy = folder / "biodance"
    shutil.copytree(CHECKOUT, copy, ignore=shutil.ignore_patterns(*NOT_COPIED))
    compiled = ("compileall", "-q", "--invalidation-mode", "checked-hash", "biodance")
    subprocess.run([sys.executable, "-m", *compiled], cwd=copy, check=True)
    found = _python(copy, "-c", "import biodance; print(biodance.__file__)").stdout.strip()
    if Path(found).resolve().parent != (copy / "biodance").resolve():
        raise SystemExit(f"The copy would test {found} instead of itself. Is biodance on another path before it?")
    return copy


def _python(copy: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the copy, so that only the copy's modules are imported and nothing is written beside them."""
    own = {
        "PYTHONPATH": str(copy),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": str(copy / ".numba"),
        "MPLBACKEND": "Agg",
    }
    command, both = [sys.executable, *arguments], os.environ | own
    return subprocess.run(command, cwd=copy, env=both, capture_output=True, text=True, timeout=PATIENCE, check=False)


def run_tests(copy: Path, tests: Sequence[str], *options: str) -> tuple[int, str]:
    """Return pytest's exit code and output for ``tests`` in ``copy``."""
    try:
        ran = _python(copy, "-m", "pytest", "-p", "no:cacheprovider", "--no-header", *options, *tests)
    except subprocess.TimeoutExpired:
        return ERRORS[0], f"no answer within {PATIENCE:g} s"
    return ran.returncode, ran.stdout + ran.stderr


def refuse_red_tests(copy: Path, mutants: Sequence[Mutant]) -> None:
    """Stop if a named test fails on the unbroken code, where it would seem to kill."""
    tests = dict.fromkeys(test for mutant in mutants for test in mutant.tests)
    code, output = run_tests(copy, tuple(tests))
    if code != ALL_PASSED:
        named = "\n  ".join(FAILED.findall(output)) or "(see above)"
        raise SystemExit(
            f"{output[-1500:]}\nThese fail without any mutant, so they kill nothing:\n  {named}\nMend them first."
        )


def broken_files(copy: Path, mutant: Mutant) -> dict[Path, str]:
    """Return the files of ``copy`` that change, with their new text: the mutant's, and beside a table the file that
    holds its digest, as of somebody who means the change (otherwise the digest alone would kill every one).
    """
    path = copy / mutant.file
    before = path.read_bytes()
    changed = {path: broken_text(mutant, before.decode())}
    beside = path.with_suffix(".toml")
    if path.suffix == ".csv" and beside.is_file():
        old, new = (hashlib.sha256(content).hexdigest() for content in (before, changed[path].encode()))
        changed[beside] = beside.read_text(encoding="utf-8").replace(old, new)
    return changed


@contextmanager
def broken(copy: Path, mutant: Mutant) -> Iterator[None]:
    """Have the mutant's line broken in ``copy``; what numba keeps compiled knows nothing of a broken callee."""
    changed = broken_files(copy, mutant)
    before = {path: path.read_bytes() for path in changed}
    for path, text in changed.items():
        path.write_bytes(text.encode())
    try:
        yield
    finally:
        for path, content in before.items():
            path.write_bytes(content)
        if "/compiled/" in mutant.file:
            shutil.rmtree(copy / ".numba", ignore_errors=True)


def judge(copy: Path, mutant: Mutant) -> Outcome:
    """Return what the mutant's tests say of it."""
    start = time.perf_counter()
    with broken(copy, mutant):
        code, output = run_tests(copy, mutant.tests, "-x")
    seconds, failed = time.perf_counter() - start, FAILED.search(output)
    if code in ERRORS or (code != ALL_PASSED and failed is None):
        return Outcome(mutant.name, "broken run", output[-300:].replace("\n", " "), seconds, fingerprint(mutant))
    if failed is None:
        return Outcome(mutant.name, "survived", "", seconds, fingerprint(mutant))
    return Outcome(mutant.name, "killed", failed[1], seconds, fingerprint(mutant))


def judge_all(mutants: Sequence[Mutant], jobs: int) -> Iterator[Outcome]:
    """Yield the outcomes of the mutants as they come, by ``jobs`` side by side, each in its own copy."""
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder, ThreadPoolExecutor(jobs) as workers:
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(jobs):
            copies.put(copied_checkout(Path(folder) / str(number)))
        first = copies.get()
        refuse_red_tests(first, mutants)
        copies.put(first)

        def task(mutant: Mutant) -> Outcome:
            copy = copies.get()
            try:
                return judge(copy, mutant)
            finally:
                copies.put(copy)

        try:
            yield from workers.map(task, mutants)
        finally:
            workers.shutdown(cancel_futures=True)


def is_good(mutant: Mutant, outcome: Outcome) -> bool:
    """Return whether the mutant was killed, one of safety fast enough."""
    return outcome.fate == "killed" and (not mutant.safety or outcome.seconds < SAFETY_SECONDS)


def table_of(mutants: Sequence[Mutant], outcomes: dict[str, Outcome]) -> str:
    """Return the outcomes as a Markdown table."""
    rows = ["| mutant | why the line matters | killed by | s |", "|---|---|---|---|"]
    for mutant in mutants:
        one = outcomes[mutant.name]
        by = f"`{one.by.removeprefix('tests/').split('[')[0]}`" if one.fate == "killed" else f"**{one.fate}**"
        rows.append(
            f"| {mutant.name}{' (safety)' if mutant.safety else ''} | {mutant.why} | {by} | {one.seconds:.1f} |"
        )
    return "\n".join(rows)


def main() -> int:
    """Run the mutants that are asked for and were not run yet; 1 when one survives or is killed too late."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("names", nargs="*", help="mutants of the table (all)")
    parser.add_argument("--jobs", type=int, default=1, help="how many side by side (1; timing holds for 1)")
    parser.add_argument("--out", type=Path, default=Path("build/mutants"), help="folder that keeps the results")
    parser.add_argument("--again", action="store_true", help="run also those that have a result")
    chosen = parser.parse_args()
    every = read_mutants()
    if unknown := set(chosen.names) - {one.name for one in every}:
        parser.error(f"no such mutant: {', '.join(sorted(unknown))}; they are {', '.join(one.name for one in every)}")
    asked = [one for one in every if not chosen.names or one.name in chosen.names]
    chosen.out.mkdir(parents=True, exist_ok=True)
    kept = chosen.out / "results.json"
    known = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else []
    outcomes = {one["name"]: Outcome(**one) for one in known}
    fresh = {one.name for one in asked if one.name in outcomes and outcomes[one.name].of == fingerprint(one)}
    todo = [one for one in asked if chosen.again or one.name not in fresh]
    for outcome in judge_all(todo, chosen.jobs) if todo else ():
        outcomes[outcome.name] = outcome
        print(f"{outcome.name:32} {outcome.fate:10} {outcome.seconds:6.1f} s  {outcome.by}", flush=True)
        kept.write_text(json.dumps([asdict(one) for one in outcomes.values()], indent=1) + "\n", encoding="utf-8")
    print(table_of(asked, outcomes))
    bad = [one.name for one in asked if not is_good(one, outcomes[one.name])]
    print(f"{len(asked) - len(bad)} of {len(asked)} killed" + (f"; NOT, or too late: {', '.join(bad)}" if bad else ""))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
