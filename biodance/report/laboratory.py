"""What a laboratory learned: ``lab.toml``, to be read by people and by ``--lab``, numbers for programs, and what
`biodance learn` prints.

``[laboratory]`` says when and from what; ``[tolerances]`` is what the diagnosis needs (`uncertainty.tolerances`),
every size with what it rests on; ``[norms."..."]`` is what is usual of instruments, people and observations;
``[normal."..."]`` are bands of joint angles, moments and powers of healthy people, ``[gait_deviation_index]`` what that
index is told against. Corrections that were accepted stand in
``[corrections]`` of the same file.
"""

import json
import re

from rich.console import Console

from biodance.cycles.scores import deviation_toml, normal_toml
from biodance.pipeline.lab_file import PLUG_IN_GAIT
from biodance.pipeline.learn import LearnedLaboratory
from biodance.report.plates import print_left_out
from biodance.report.tables.schema import Row, Schema
from biodance.report.terminal import print_line, print_table
from biodance.uncertainty.tolerances import shipped, to_toml

HARDLY = 0.5
"""Coefficients below which a size is the shipped one."""
NORM_ROW = Schema(
    "name value sd between_sessions_sd=between unit sessions observations",
    shown="what: {name} | usual: {value:.3g} | sd between sessions: {between_sessions_sd:.2g} | unit: {unit} | "
    "sessions: {sessions}",
)
"""What is usual of instruments, people and observations."""


def learned_document(found: LearnedLaboratory) -> Row:
    """Return what was learned: sessions, norms, and the sizes that changed most."""
    before, own = shipped(), found.tolerances
    ratio = {
        key: size / before.size(key)
        for key, size in (own.sizes if own else {}).items()
        if before.size(key) > 0 and found.shown.get(key, 0.0) >= HARDLY
    }
    most = sorted(ratio, key=lambda key: -max(ratio[key], 1 / ratio[key]))[:10]
    return {
        "sessions": list(found.sessions),
        "left_out": dict(found.left_out),
        "learned_utc": found.created,
        "norms": NORM_ROW.rows(found.norms),
        "changed_most": [
            {"key": key, "size": own.size(key), "shipped": before.size(key), "values": found.shown[key]}
            for key in most
            if own
        ],
        "healthy": {
            "bands": [Schema("kind quantity unit people").row(one) for one in found.healthy.normal],
            "gait_deviation_index": found.healthy.deviation is not None,
        },
    }


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
    healthy = found.healthy
    bands = [*normal_toml(healthy.normal), *normal_toml(healthy.beside, PLUG_IN_GAIT)]
    bands += [*(deviation_toml(healthy.deviation) if healthy.deviation else ())]
    return "\n".join([*head, *_tolerances(found), "", *_norms(found), *bands]).rstrip() + "\n"


def _tolerances(found: LearnedLaboratory) -> list[str]:
    """Return the lines of ``[tolerances]``, every size with what it rests on."""
    if found.tolerances is None:
        return ["# Too few sessions without fault for tolerances of its own: the shipped ones hold."]
    lines, before, within = [], shipped(), ""
    for line in to_toml(found.tolerances, under="tolerances").splitlines():
        within = line if line.startswith("[") else within
        if within == "[tolerances.sizes]" and (size := _SIZE.match(line)):
            key, count = size["key"], found.shown.get(size["key"], 0.0)
            basis = f"{count:.1f} values in {len(found.sessions)} sessions; shipped {before.size(key):.4g}"
            line = f"{line}  # {'as shipped: no session shows it' if count < HARDLY else basis}"
        lines.append(line)
    return lines


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


def print_learned(document: Row, console: Console) -> None:
    """Print what a laboratory learned: sessions, norms, what changed most."""
    print_line(console, f"Learned from {len(document['sessions'])} sessions: {', '.join(document['sessions'])}")
    print_table(NORM_ROW, document["norms"], console)
    for one in document["changed_most"]:
        print_line(console, f"{one['key']}: {one['size']:.3g} instead of {one['shipped']:.3g}")
    if bands := document["healthy"]["bands"]:
        people = max(one["people"] for one in bands)
        index = "with" if document["healthy"]["gait_deviation_index"] else "too few legs or strides for"
        print_line(console, f"Healthy reference: {people} people, {len(bands)} curves, {index} gait deviation index.")
    print_left_out(document["left_out"], console)
