"""What a laboratory learned: ``lab.toml``, to be read by people and by ``--lab``, and what `biodance plates` and
`biodance learn` print.

``[laboratory]`` says when and from what; ``[tolerances]`` is what the diagnosis needs (`uncertainty.tolerances`),
every size with what it rests on; ``[norms."..."]`` is what is usual of instruments, people and observations;
``[normal."..."]`` are bands of joint angles, moments and powers. Corrections
that were accepted stand in ``[corrections]`` of the same file.
"""

import json
import re
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from biodance.cycles.curves import normal_toml
from biodance.errors import SessionRefused
from biodance.pipeline.learn import LearnedLaboratory
from biodance.report.documents.plain import keyed
from biodance.report.files import refuse_missing_folder
from biodance.report.wording import format_number, millimetres
from biodance.uncertainty.tolerances import shipped, to_toml

_HARDLY = 0.5
"""Coefficients below which a size is the shipped one."""
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
        *[f"# left out: {name}: {_one_line(why)}" for name, why in found.left_out.items()],
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
    if count < _HARDLY:
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


def _one_line(text: str) -> str:
    return " ".join(text.split())


def write_lab_file(found: LearnedLaboratory, path: Path) -> None:
    """Write lab.toml; refuse where there is a file already.

    Raises
    ------
    SessionRefused
        The file exists, or cannot be written.
    """
    try:
        with open(path, "x", encoding="utf-8", newline="\n") as stream:
            stream.write(lab_file_text(found))
    except FileExistsError:
        refuse_existing(path)
    except OSError as why:
        raise SessionRefused(f"{path}: cannot be written ({why.strerror or why}). Choose another place.") from why


def refuse_existing(path: Path) -> None:
    """Raise SessionRefused where ``path`` exists, BiodanceError where it has no folder: before long work starts, and
    never over an existing file.
    """
    if path.exists():
        raise SessionRefused(f"{path}: exists already and is never overwritten. Choose another name, or move it away.")
    refuse_missing_folder(path)


def learned_document(found: LearnedLaboratory) -> dict[str, Any]:
    """Return what was learned as plain values: sessions, norms, and the sizes that changed most."""
    before = shipped()
    ratio = {
        key: size / before.size(key)
        for key, size in found.tolerances.sizes.items()
        if before.size(key) > 0 and found.shown.get(key, 0.0) >= _HARDLY
    }
    most = sorted(ratio, key=lambda key: -max(ratio[key], 1 / ratio[key]))[:10]
    return {
        "sessions": list(found.sessions),
        "left_out": dict(found.left_out),
        "learned_utc": found.created,
        "norms": [
            keyed(norm, "name value sd between_sessions_sd=between unit sessions observations") for norm in found.norms
        ],
        "changed_most": [
            {"key": key, "size": found.tolerances.size(key), "shipped": before.size(key), "values": found.shown[key]}
            for key in most
        ],
    }


def print_plates(document: dict[str, Any], console: Console) -> None:
    """Print a row per plate, then everything that a person must see."""
    table = Table("plate", "visits", "place x, y (mm)", "gain (%)", "offset Fx, Fy, Fz (N)", "delay (ms)", "changes")
    for card in document["plates"]:
        gain, delay = card["gain"], card["delay_s"]
        table.add_row(
            card["plate"],
            str(card["visits"]),
            ", ".join(millimetres(value) for value in card["place_m"]),
            format_number(None if gain is None else 100 * gain, 2),
            ", ".join(format_number(value) for value in card["offset_n"]),
            millimetres(delay),
            str(len(card["changes"])),
        )
    console.print(table)
    for one in document["attention"]:
        console.print(escape(one["text"]), soft_wrap=True)
    for person in document["persons"]:
        for one in person["findings"]:
            console.print(escape(f"Person {person['person']}: {one['text']}"), soft_wrap=True)
    for what, why in document["refused"].items():
        console.print(escape(f"{what} was left out: {why.splitlines()[0]}"), soft_wrap=True)
    for note in document["notes"]:
        console.print(escape(note), soft_wrap=True)


def print_learned(document: dict[str, Any], console: Console) -> None:
    """Print what a laboratory learned: sessions, norms, what changed most."""
    console.print(f"Learned from {len(document['sessions'])} sessions: {', '.join(document['sessions'])}")
    table = Table("what", "usual", "sd between sessions", "unit", "sessions")
    for one in document["norms"]:
        table.add_row(
            one["name"], f"{one['value']:.3g}", f"{one['between_sessions_sd']:.2g}", one["unit"], str(one["sessions"])
        )
    console.print(table)
    for one in document["changed_most"]:
        console.print(f"{one['key']}: {one['size']:.3g} instead of {one['shipped']:.3g}", highlight=False)
    for what, why in document["left_out"].items():
        console.print(escape(f"{what} was left out: {why.splitlines()[0]}"), soft_wrap=True)
