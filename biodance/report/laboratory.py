"""What a laboratory learned: ``lab.toml``, to be read by people and by ``--lab``, and what `biodance plates` and
`biodance learn` print.

``[laboratory]`` says when and from what; ``[tolerances]`` is what the diagnosis needs (`uncertainty.tolerances`),
every size with what it rests on; ``[norms."..."]`` is what is usual of instruments, people and observations;
``[normal."..."]`` are bands of joint angles, moments and powers. Corrections
that were accepted stand in ``[corrections]`` of the same file.
"""

import json
import re
from collections.abc import Mapping

from rich.console import Console

from biodance.cycles.curves import normal_toml
from biodance.pipeline.learn import LearnedLaboratory
from biodance.report.tables.laboratory import CARD_ROW, HARDLY, NORM_ROW
from biodance.report.tables.schema import Row
from biodance.report.terminal import print_line, print_table
from biodance.uncertainty.tolerances import shipped, to_toml

_SIZE = re.compile(r'^"(?P<key>[^"]+)" = (?P<value>[-+.\deE]+)$')


def lab_file_text(found: LearnedLaboratory) -> str:
    """Return the text of lab.toml."""
    head = [
        "# What this laboratory learned from its own sessions without fault; for biodance diagnose --lab.",
        "# Learn again when cameras, plates or marker sets change.",
        "",
        "[laboratory]",
        f"learned_utc = {found.created}",
        f"archive = {json.dumps(found.archive.resolve().name)}",
        f"sessions = {json.dumps(list(found.sessions), ensure_ascii=False)}",
        *[f"# left out: {name}: {' '.join(why.split())}" for name, why in found.left_out.items()],
        "",
    ]
    return "\n".join([*head, *_tolerances(found), "", *_norms(found), *normal_toml(found.normal)]).rstrip() + "\n"


def _tolerances(found: LearnedLaboratory) -> list[str]:
    """Return the lines of ``[tolerances]``, every size with what it rests on."""
    lines, before, within = [], shipped(), ""
    for line in to_toml(found.tolerances, under="tolerances").splitlines():
        within = line if line.startswith("[") else within
        size = _SIZE.match(line) if within == "[tolerances.sizes]" else None
        lines.append(f"{line}  # {_basis(size['key'], found, before.size(size['key']))}" if size else line)
    return lines


def _basis(key: str, found: LearnedLaboratory, before: float) -> str:
    count = found.shown.get(key, 0.0)
    if count < HARDLY:
        return "as shipped: no session shows it"
    return f"{count:.1f} values in {len(found.sessions)} sessions; shipped {before:.4g}"


def _norms(found: LearnedLaboratory) -> list[str]:
    """Return the tables of norms."""
    lines = []
    for one in found.norms:
        lines += [
            f"[norms.{json.dumps(one.name)}]",
            f"value = {one.value:.4g}",
            f"sd = {one.sd:.4g}",
            f"between_sessions_sd = {one.between:.4g}",
            f"unit = {json.dumps(one.unit, ensure_ascii=False)}",
            f"sessions = {one.sessions}",
            f"observations = {one.observations}",
            "",
        ]
    return lines


def _print_left_out(left_out: Mapping[str, str], console: Console) -> None:
    for what, why in left_out.items():
        print_line(console, f"{what} was left out: {why.splitlines()[0]}")


def print_plates(document: Row, console: Console) -> None:
    """Print a row per plate, then everything that a person must see."""
    print_table(CARD_ROW, document["plates"], console)
    for one in document["attention"]:
        print_line(console, one["text"])
    for person in document["persons"]:
        for one in person["findings"]:
            print_line(console, f"Person {person['person']}: {one['text']}")
    _print_left_out(document["refused"], console)
    for note in document["notes"]:
        print_line(console, note)


def print_learned(document: Row, console: Console) -> None:
    """Print what a laboratory learned: sessions, norms, what changed most."""
    print_line(console, f"Learned from {len(document['sessions'])} sessions: {', '.join(document['sessions'])}")
    print_table(NORM_ROW, document["norms"], console)
    for one in document["changed_most"]:
        print_line(console, f"{one['key']}: {one['size']:.3g} instead of {one['shipped']:.3g}")
    _print_left_out(document["left_out"], console)
