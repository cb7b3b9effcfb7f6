"""Draw lines of the whole package by chance, break each, and see whether the tests that CONTRIBUTING.md names notice.

    python tests/drawn_mutants.py [--draw 60] [--seed 20261130] [--rooms lab ...] [--out build/drawn]

`tests/mutants.toml` breaks lines that somebody chose; here the seed chooses. Every package gives equally many, and each
place in it that can be broken is as likely: a comparison, an operator of arithmetic or logic, a minus, a number. What
is only shown (f-strings, docstrings, ``raise``) is left out. Results are kept in ``--out``, so that a run that was
interrupted goes on. A kill counts if the same test passes on the whole line. A survivor is a line that nobody guards or
a change that changes nothing (a tolerance, a start of a search): whoever reads it says which.
"""

import argparse
import ast
import json
import random
import re
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path

from mutants import ALL_PASSED, CHECKOUT, FAILED, Mutant, Outcome, broken, copied_checkout, fingerprint, run_tests

PACKAGE = CHECKOUT / "biodance"
NAMED = {
    "identification": ("identify", "load", "static_identification"),
    "diagnosis": ("diagnose", "archive"),
    "lab": ("lab", "marker"),
    "registration": ("registration",),
    "effects": ("effects", "newton"),
}
"""Package -> what the names of its tests begin with behind ``test_``, where that is not the package's own name."""
MOST = 3
"""Files of tests that are run for one line: those that import its module and name its function most often."""
COMPARED = {ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
COMPUTED = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
SHOWN = (ast.JoinedStr, ast.Raise, ast.Assert)
PATH = re.compile(r"(?i)path|folder|parent|root|['\"]")
"""A ``/`` between such words joins paths: ``*`` there is an error that tells nothing of the tests."""


def seen(tree: ast.AST, name: str = "") -> Iterator[tuple[ast.AST, str]]:
    """Yield every node that computes something, with the names of the functions and classes that hold it."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, SHOWN) or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            continue
        if isinstance(node, ast.keyword) and node.arg == "strict":  # of zip: a check that never fails
            continue
        inner = f"{name} {node.name}" if isinstance(node, ast.FunctionDef | ast.ClassDef) else name
        if isinstance(node, ast.FunctionDef):  # annotations and decorators are no computation
            for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
                yield from ((part, inner), *seen(part, inner))
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                yield from ((node.value, inner), *seen(node.value, inner))
        else:
            yield from ((node, inner), *seen(node, inner))


def broken_node(node: ast.AST) -> str | None:
    """Return the node's code as something else, or None where there is nothing to break."""
    match node:
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARED:
            return f"({ast.unparse(left)} {COMPARED[type(op)]} {ast.unparse(right)})"
        case ast.BinOp(op=ast.Div()) if PATH.search(ast.unparse(node)):
            return None
        case ast.BinOp(left=left, op=op, right=right) if type(op) in COMPUTED and not _text(left) and not _text(right):
            return f"(({ast.unparse(left)}) {COMPUTED[type(op)]} ({ast.unparse(right)}))"
        case ast.BoolOp(op=op, values=values):
            other = " or " if isinstance(op, ast.And) else " and "
            return f"({other.join(f'({ast.unparse(one)})' for one in values)})"
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            return f"({ast.unparse(operand)})"
        case ast.Constant(value=bool() as value):
            return str(not value)
        case ast.Constant(value=int() | float() as value):
            return repr(value + 1 if isinstance(value, int) else 2 * value or 1.0)
    return None


def _text(node: ast.expr) -> bool:
    """Return whether a side of a sum is text or a list, whose minus is an error that tells nothing."""
    return isinstance(node, ast.JoinedStr | ast.Tuple | ast.List) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def places(path: Path) -> list[tuple[Path, ast.AST, str]]:
    """Return everything in a file that can be broken: the file, the node, and what holds it."""
    nodes = seen(ast.parse(path.read_text(encoding="utf-8")))
    return [(path, node, holder) for node, holder in nodes if broken_node(node) and node.lineno == node.end_lineno]


def mutant_at(path: Path, node: ast.AST, holder: str) -> Mutant:
    """Return the mutant of a place: its line, with as many lines above it as make it the only such one in the file."""
    text = path.read_text(encoding="utf-8")
    lines, row, new = text.splitlines(keepends=True), node.lineno - 1, broken_node(node)
    line = lines[row].encode()
    after = (line[: node.col_offset] + new.encode() + line[node.end_col_offset :]).decode()
    first = row
    while first and text.count("".join(lines[first : row + 1])) > 1:
        first -= 1
    above, file = "".join(lines[first:row]), path.relative_to(CHECKOUT).as_posix()
    name, why = f"{file}:{node.lineno}:{node.col_offset}", f"{ast.unparse(node)} -> {new}"
    return Mutant(name, file, above + lines[row], above + after, guards(file, holder), why)


@cache
def guards(file: str, holder: str) -> tuple[str, ...]:
    """Return the files of tests for a line: those of its package by their names, and those that import its module, and
    those that name it or the class or function that holds the line; where all three are so, first.
    """
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    outer, _, own = module.rpartition(".")
    room = file.split("/")[1].removesuffix(".py")
    begin = tuple(f"test_{one}" for one in (*NAMED.get(room, (room,)), own))
    holders = holder.split() or [""]
    if holders[0].startswith("_") or not holders[0]:  # what calls it stands in the same file
        tree = ast.parse((CHECKOUT / file).read_text(encoding="utf-8"))
        holders += [node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    holders = [name for name in holders if len(name) > 5 and not name.startswith("_")]  # not `check`, `name`
    public = dict.fromkeys([*holders, own])
    score = {}
    for path in sorted((CHECKOUT / "tests").glob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        imported = module in text or re.search(rf"from {outer} import .*\b{own}\b", text) is not None
        called = sum(len(re.findall(rf"\b{name}\b", text)) for name in public)
        if imported or called or path.stem.startswith(begin):
            score[f"tests/{path.name}"] = (2 * imported + 2 * path.stem.startswith(begin) + bool(called), called)
    return tuple(sorted(score, key=lambda one: score[one], reverse=True)[:MOST])


def drawn(count: int, seed: int, rooms: Sequence[str]) -> list[Mutant]:
    """Return ``count`` mutants, equally many of every package, at places that the seed chooses."""
    chance = random.Random(seed)
    files = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        files[room if (PACKAGE / room).is_dir() else "biodance"].append(path)
    chosen = [room for room in sorted(files) if not rooms or room in rooms]
    chance.shuffle(chosen)
    left = {room: [place for path in files[room] for place in places(path)] for room in chosen}
    for room in chosen:
        chance.shuffle(left[room])
    order = [room for _ in range(count) for room in chosen]
    return [mutant_at(*left[room].pop()) for room in order[:count]]


def judged(copy: Path, mutant: Mutant) -> Outcome:
    """Return what the tests say of a drawn mutant; what fails on the whole line, too, kills nothing."""
    start = time.perf_counter()
    with broken(copy, mutant):
        code, output = run_tests(copy, mutant.tests, "-x") if mutant.tests else (ALL_PASSED, "")
    failed = FAILED.search(output)
    seconds = time.perf_counter() - start
    if code == ALL_PASSED:
        return Outcome(mutant.name, "survived", "", seconds, fingerprint(mutant))
    if failed is None or run_tests(copy, (failed[1].split("[")[0],), "-x")[0] != ALL_PASSED:
        return Outcome(mutant.name, "broken run", output[-300:].replace("\n", " "), seconds, fingerprint(mutant))
    return Outcome(mutant.name, "killed", failed[1], seconds, fingerprint(mutant))


def main() -> int:
    """Draw, break, judge and count."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--draw", type=int, default=60)
    parser.add_argument("--seed", type=int, default=20261130)
    parser.add_argument("--rooms", nargs="*", default=())
    parser.add_argument("--out", type=Path, default=Path("build/drawn"))
    parser.add_argument("--list", action="store_true", help="say what would be broken, and by which tests")
    asked = parser.parse_args()
    mutants = drawn(asked.draw, asked.seed, asked.rooms)
    if asked.list:
        print("\n".join(f"{one.name}  {one.why}  {' '.join(one.tests)}" for one in mutants))
        return 0
    asked.out.mkdir(parents=True, exist_ok=True)
    kept = asked.out / "results.json"
    known = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else []
    outcomes = {one["name"]: Outcome(**one) for one in known}
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        copy = copied_checkout(Path(folder))
        for mutant in mutants:
            if mutant.name in outcomes and outcomes[mutant.name].of == fingerprint(mutant):
                continue
            outcome = outcomes[mutant.name] = judged(copy, mutant)
            print(f"{outcome.fate:10} {outcome.seconds:6.1f} s  {mutant.name}  {mutant.why}  {outcome.by}", flush=True)
            kept.write_text(json.dumps([asdict(one) for one in outcomes.values()], indent=1) + "\n", encoding="utf-8")
    fates = [outcomes[one.name].fate for one in mutants]
    print(f"{fates.count('killed')} of {len(fates)} killed, {fates.count('broken run')} could not be judged")
    return 0


if __name__ == "__main__":
    sys.exit(main())
