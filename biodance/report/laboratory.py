"""A laboratory over all its sessions: its plates (numbers, page, print), and the lab.toml that it learned."""

import json
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from biodance.cycles.scores import deviation_toml, normal_toml
from biodance.diagnosis.archive.candidates import ALL
from biodance.diagnosis.archive.changes import History
from biodance.diagnosis.archive.conditions import ConditionEffect
from biodance.diagnosis.archive.judge import PlateLevel, said
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES
from biodance.display import BLACK, BLUE, GREY, RED, spaced
from biodance.pipeline.lab_file import PLUG_IN_GAIT
from biodance.pipeline.learn import LearnedLaboratory, PlatesJudged
from biodance.pipeline.saved_results import now
from biodance.report.figures.style import figure, look, svg_address
from biodance.report.files import csv_text, write_results
from biodance.report.pages.template import print_sheet, render, template_text
from biodance.report.tables.schema import Row, Schema
from biodance.report.terminal import print_line, print_table
from biodance.uncertainty.tolerances import shipped, to_toml

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_OFFSET = ("offset_x", "offset_y", "offset_z")
_UNIT: Mapping[str, Callable[[Any], str]] = {"unit": lambda one: PLATE_QUANTITIES[one.quantity].unit}


CARD_ROW = Schema(
    "plate visits place_m=place_x.value,place_y.value place_sd_m=place_x.sd,place_y.sd gain=gain.value gain_sd=gain.sd "
    "offset_n=offset_x.value,offset_y.value,offset_z.value offset_sd_n=offset_x.sd,offset_y.sd,offset_z.sd "
    "delay_s=delay.value delay_sd_s=delay.sd",
    {
        "offset_taken_off": lambda card: min((card[one].taken_off for one in _OFFSET if one in card), default=None),
        "levels": Schema("quantity value sd between_visits_sd=between visits", _UNIT),
        "changes": Schema(
            "visit=visit.name plate quantity before after ci95=interval matters",
            {
                "date": lambda one: one.visit.date or None,
                "earliest": lambda one: one.earliest.date or one.earliest.name,
                "latest": lambda one: one.latest.date or one.latest.name,
                **_UNIT,
            },
        ),
        "findings": Schema("effect target text quantity value ci95=interval", _UNIT),
    },
    "plate: {plate} | visits: {visits} | place x, y (mm): {place_m:mm1} | gain (%): {gain:%2} | "
    "offset Fx, Fy, Fz (N): {offset_n:1} | delay (ms): {delay_s:ms1} | changes: {changes:count}",
)
"""A plate over all its visits, its levels by their quantity, too. Of a change ``ci95`` is of the step, ``date`` of the
first visit after it.
"""
_CONDITION = Schema(
    "plate quantity factor level base value=shared.mean ci95=shared.interval between_persons_sd=shared.spread "
    "persons=#visits",
    {**_UNIT, "persons_named": lambda one: sorted(one.persons)},
)


def plates_document(found: PlatesJudged) -> Row:
    """Return a card per plate, persons, what all share, and what was left out; null for an untold quantity."""
    judged = found.judgement
    once = [card.plate for card in judged.plates if card.visits < 2]
    alone = (
        f"{', '.join(once)}: not judged, as one visit cannot tell a plate's fault from a person's. Report the session."
    )
    return {
        "archive": found.archive.resolve().name,
        "visits": Schema("visit=name person date", {"date": lambda one: one.date or None}).rows(judged.visits),
        "plates": CARD_ROW.rows(vars(card) | {one.quantity: one for one in card.levels} for card in judged.plates),
        "persons": _persons(found),
        "common": _CONDITION.rows(judged.conditions),
        "attention": [
            {"level": "warn", "text": f"{card.plate}: {one.text}", "trial": "", "about": one.effect}
            for card in judged.plates
            for one in card.findings
        ],
        "refused": dict(found.refused),
        "notes": [*found.notes, *([alone] if once else ())],
    }


def _persons(found: PlatesJudged) -> list[Row]:
    """Return every person with visits, what stands out, and what conditions do in that person's visits."""
    judged = found.judgement
    visits = Counter(visit.person for visit in judged.visits)
    findings: dict[str, list[Row]] = defaultdict(list)
    for one in judged.strangers:
        much, when = said(one.quantity, one.value), one.visit or "All visits"
        text = f"{when}: {spaced(one.quantity)} on {one.plate} differs by {much} from all others."
        findings[one.person].append(_personal(text, one.quantity, one.value, one.sd))
    for shared in judged.conditions:
        for name, (value, sd) in shared.persons.items():
            much = said(shared.quantity, value)
            text = f"{shared.factor} {shared.level} reads {much} more than {shared.factor} {shared.base}."
            findings[name].append(_personal(text, shared.quantity, value, sd))
    return [{"person": name, "visits": count, "findings": findings[name]} for name, count in visits.items()]


def _personal(text: str, quantity: str, value: float, sd: float) -> Row:
    known, interval = PLATE_QUANTITIES[quantity], [value - 1.96 * sd, value + 1.96 * sd]
    row = {"effect": known.effect, "target": known.target, "text": text, "quantity": quantity, "value": value, "sd": sd}
    return {**row, "ci95": interval, "unit": known.unit}


_SHOWN = {"m": (1e3, "mm"), "s": (1e3, "ms"), "1": (1e2, "%"), "N": (1.0, "N")}
QUANTITY_TITLES = {
    "place_x": "place along x",
    "place_y": "place along y",
    "gain": "gain error",
    "offset_x": "offset Fx",
    "offset_y": "offset Fy",
    "offset_z": "offset Fz",
    "delay": "delay of the forces",
}


_LEVEL = Schema(
    "",
    shown="quantity: {quantity} | value: {value} | 95 % interval: {low} to {high} | between visits (sd): {between} | "
    "visits: {visits}",
)
_PERSON = Schema("", shown="person: {person} | visits: {visits} | what stands out: {found}")


def _level(one: PlateLevel) -> Row:
    """Return a level in words."""
    reach = 1.96 * one.sd
    ends = {"value": one.value, "low": one.value - reach, "high": one.value + reach, "between": one.between}
    words = {key: said(one.quantity, value) for key, value in ends.items()}
    title = QUANTITY_TITLES[one.quantity] + (" (taken off by the reader)" if one.taken_off > 0.5 else "")
    return {**words, "quantity": title, "between": words["between"].lstrip("+"), "visits": one.visits}


def plate_figure(plate: str, histories: tuple[History, ...]) -> "Figure":
    """Draw every quantity of one plate over the visits, with level and changes; not one that never changes."""
    own = [one for one in histories if plate in one.series.plates]
    own = [one for one in own if np.ptp(one.series.value[_rows(plate, one)]) > 0] or own
    columns = min(2, len(own))
    rows = -(-len(own) // columns)
    with look():
        drawn = figure(1.35 * rows + 0.4)
        grid = drawn.subplots(rows, columns, sharex=True, squeeze=False).T.ravel()
        for axes, one in zip(grid, own, strict=False):
            _draw(axes, plate, one)
        for axes in grid[len(own) :]:
            axes.remove()
        for k in {min((c + 1) * rows, len(own)) - 1 for c in range(columns)}:
            # dates, else names, of as many visits as fit
            visits = own[k].series.visits
            chosen = np.unique(np.linspace(0, len(visits) - 1, min(len(visits), 6)).round().astype(int))
            words = [visits[i].date[:10] or visits[i].name[-12:] for i in chosen]
            grid[k].tick_params(labelbottom=True)
            grid[k].set_xticks(chosen, words, rotation=25, ha="right")
    return drawn


def _rows(plate: str, one: History) -> NDArray[np.bool_]:
    """Return which values of a quantity are of ``plate``."""
    return np.asarray(one.series.design[:, one.series.plates.index(plate)] != 0)


def _draw(axes: "Axes", plate: str, one: History) -> None:
    """Draw one quantity: points with 95 % of the visit's own error, steps of the level, people who stand out."""
    series, (factor, unit) = one.series, _SHOWN[PLATE_QUANTITIES[one.series.quantity].unit]
    rows = _rows(plate, one)
    at, value, sd = series.visit[rows], factor * series.value[rows], factor * series.sd[rows]
    axes.errorbar(at, value, 1.96 * sd, fmt="o", color=BLUE, markersize=3.5, linewidth=0.8)
    strange = [i for i, v in enumerate(at) if any(s.visit == series.visits[v].name for s in one.strangers)]
    axes.plot(at[strange], value[strange], "o", markersize=9, markerfacecolor="none", markeredgecolor=RED)
    level = factor * one.level_over_time(plate)
    during = np.arange(at.min(), at.max() + 1)  # elsewhere this plate was not
    axes.step(during, level[during], where="mid", color=BLACK, linewidth=1.2)
    for change in one.changes:
        if change.plate in (plate, ALL):
            first, last = (series.visits.index(v) for v in (change.earliest, change.latest))
            axes.axvspan(first - 0.5, last - 0.45, color=RED, alpha=0.15, linewidth=0)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set_ylabel(f"{QUANTITY_TITLES[series.quantity]}\n({unit})")


def condition_figure(one: ConditionEffect) -> "Figure":
    """Draw what a kind of trial reads more in every person, and what all share."""
    factor, unit = _SHOWN[PLATE_QUANTITIES[one.quantity].unit]
    names = [visit.person for visit in one.visits]
    with look():
        drawn = figure(0.9 + 0.22 * len(names))
        axes = drawn.subplots()
        axes.errorbar(
            factor * one.shared.own, range(len(names)), xerr=1.96 * factor * one.shared.own_sd, fmt="o", color=BLUE
        )
        low, high = (factor * x for x in one.shared.interval)
        axes.axvspan(low, high, color=GREY, alpha=0.25, linewidth=0)
        axes.axvline(0, color=BLACK, linewidth=0.8)
        axes.set_yticks(range(len(names)), [f"person {name}" for name in names])
        axes.set_xlabel(
            f"{one.factor} {one.level} less {one.factor} {one.base}: {QUANTITY_TITLES[one.quantity]} ({unit})"
        )
    return drawn


def plates_page(found: PlatesJudged, document: dict[str, Any]) -> str:
    """Return the page as HTML text."""
    from markupsafe import Markup

    judged = found.judgement
    count, made, title = len(judged.findings), now(), f"The plates of {document['archive']}"
    dates = sorted(visit.date[:10] for visit in found.judgement.visits if visit.date)
    seen = "nothing wrong was found" if any(card.visits > 1 for card in judged.plates) else "none can be judged yet"
    return render(
        "plates.html.j2",
        style=Markup(template_text("page.css")) + print_sheet(title, {}, made),
        name=document["archive"],
        created=made,
        answer=f"{count} finding{'s' if count != 1 else ''}" if count else seen,
        judged=judged,
        dates=(f", {dates[0]} to {dates[-1]}" if dates and len(dates) == len(found.judgement.visits) else ""),
        persons=[
            one | {"found": " ".join(found["text"] for found in one["findings"]) or "nothing"}
            for one in document["persons"]
        ],
        figures={card.plate: svg_address(plate_figure(card.plate, judged.histories)) for card in judged.plates},
        conditions=[(one, svg_address(condition_figure(one))) for one in judged.conditions],
        levels={card.plate: list(map(_level, card.levels)) for card in judged.plates},
        schemas={"level": _LEVEL, "person": _PERSON},
        notes=document["notes"],
        refused=found.refused,
    )


def write_plates(found: PlatesJudged, folder: Path) -> dict[str, Any]:
    """Write ``report.html``, ``results.json``, ``plates.csv`` into ``folder`` (which exists) and return the numbers."""
    document = plates_document(found)
    texts = {"report.html": plates_page(found, document), "plates.csv": csv_text(found.table())}
    return write_results(folder, document, texts)


def print_plates(document: Row, console: Console) -> None:
    """Print a row per plate, then everything that a person must see."""
    print_table(CARD_ROW, document["plates"], console)
    for one in document["attention"]:
        print_line(console, one["text"])
    for person in document["persons"]:
        for one in person["findings"]:
            print_line(console, f"Person {person['person']}: {one['text']}")
    print_left_out(document["refused"], console)
    for note in document["notes"]:
        print_line(console, note)


def print_left_out(left_out: Mapping[str, str], console: Console) -> None:
    """Print what was left out and why, a line each."""
    for what, why in left_out.items():
        print_line(console, f"{what} was left out: {why.splitlines()[0]}")


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
        if within == "[tolerances.sizes]" and (size := re.match(r'"(?P<key>[^"]+)" = (?P<value>[-+.\deE]+)$', line)):
            key, count = size["key"], found.shown.get(size["key"], 0.0)
            basis = f"{count:.1f} values in {len(found.sessions)} sessions; shipped {before.size(key):.4g}"
            line = f"{line}  # {'as shipped: no session shows it' if count < HARDLY else basis}"
        lines.append(line)
    return lines


def _norms(found: LearnedLaboratory) -> list[str]:
    """Return the tables of norms."""
    return [
        f"[norms.{json.dumps(one.name)}]\nvalue = {one.value:.4g}\nsd = {one.sd:.4g}\n"
        f"between_sessions_sd = {one.between:.4g}\nunit = {json.dumps(one.unit, ensure_ascii=False)}\n"
        f"sessions = {one.sessions}\nobservations = {one.observations}\n"
        for one in found.norms
    ]


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
