"""The analyst's page: one HTML file that holds all it shows and asks nothing of the network.

First what a person needs, on two printed pages: the verdict, what needs somebody, mass and key figures, the body; then,
folded, everything by trial.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import unescape
from typing import Any

import numpy as np

from biodance.identification.validation import TrialValidation
from biodance.pipeline.attention import session_attention
from biodance.pipeline.results import SessionResult
from biodance.pipeline.still import Still
from biodance.pipeline.trial import Check, TrialResult
from biodance.records import CHANNELS, AngleState, Array
from biodance.records.attention import Attention
from biodance.report.figures.session import (
    marker_figure,
    standing_figure,
    still_figure,
    validation_figure,
    wrench_figure,
)
from biodance.report.pages.identification import identification_section
from biodance.report.pages.template import print_sheet, render, script_json, template_text, three_js
from biodance.report.tables.schema import Row
from biodance.report.tables.session import GAP_ROW
from biodance.report.wording import format_number, headline_of, loud_and_noted, millimetres


def check_table(result: SessionResult) -> tuple[list[tuple[str, str]], list[tuple[TrialResult, list[Check | None]]]]:
    """Return the trials' checks as a table: its columns (what, limit), and per trial one check or None a column."""
    # the limit of forces grows with the movement of a trial: each limit has a column of its own
    columns = list(dict.fromkeys((check.what, check.limit) for trial in result.trials for check in trial.checks))
    rows = []
    for trial in result.trials:
        found = {(check.what, check.limit): check for check in trial.checks}
        rows.append((trial, [found.get(column) for column in columns]))
    return columns, rows


@dataclass(frozen=True)
class Tile:
    """One key figure: ``what``, its ``value``, what stands ``beside`` it, and whether it is inside its limit."""

    what: str
    value: str
    beside: str
    inside: bool = True


def key_figures(result: SessionResult) -> list[Tile]:
    """Return the mass and the key figures of a session: markers, forces, and what the movement told of the body."""
    tiles = []
    if result.weighed:
        declared = result.subject.declared_mass
        beside = f"declared {format_number(declared, 2)} kg ({format_number(result.mass_difference)} %)"
        beside = beside if np.isfinite(declared) else "none declared"
        outside = any(check.what.startswith("mass on") and not check.inside for check in result.checks)
        tiles.append(Tile("Mass on the plates", f"{format_number(result.weighed.mass, 2)} kg", beside, not outside))
    for start, what in (
        ("marker distance, RMS", "Markers to the body"),
        ("force difference", "Forces to the simulation"),
    ):
        if found := [check for check in result.all_checks if check.what.startswith(start)]:
            worst = max(found, key=lambda check: float(check.value.split()[0]))
            tiles.append(Tile(what, worst.value, f"worst trial {worst.where}, {worst.limit}", worst.inside))
    one = result.identification
    if one and one.identification.status == "solved":
        masses = [known.verdict for known in one.identification.known if known.quantity == "mass"]
        gain = f"kept trials fit {format_number(one.gain.force, 2)} times closer" if one.gain else "no gain is proven"
        value = f"{masses.count('known')} known, {masses.count('partly known')} partly"
        tiles.append(Tile(f"Masses of {len(masses)} segments", value, gain))
    return tiles


def _trial_part(result: TrialResult, validated: TrialValidation | None) -> dict[str, Any]:
    """Return one trial as the page shows it: its figures as HTML ("" where there is nothing to draw), its ``gaps``, the
    worst first, what was ``said`` when it was read and prepared, and the comparison of the wrenches by ``channels``.
    """
    trial, compared, motion = result.trial, result.comparison, result.motion
    filled, wrench = None if motion is None else motion.frame_state == AngleState.FILLED, ""
    if validated is not None:
        wrench = validation_figure(validated, filled=filled)
    elif compared is not None:
        wrench = wrench_figure(compared, trial.name, filled=filled)
    lines = ((plate.name, line) for plate in trial.plates for line in plate.decisions)
    channels: list[tuple[str, str, float, float]] = []
    if compared is not None:
        # who stands still presses evenly: there is nothing to correlate but noise
        alike = [math.nan] * 6 if trial.role == "static" else compared.correlation.tolist()
        channels = list(zip(CHANNELS, ("N",) * 3 + ("N·m",) * 3, compared.rms.tolist(), alike, strict=True))
    return {
        "result": result,
        "markers": marker_figure(result.fit) if result.fit else "",
        "wrench": wrench,
        "validation": validated,
        "gaps": GAP_ROW.rows(sorted((gap for gap in result.gaps if gap.percent > 0), key=lambda gap: -gap.percent)),
        # a reader's history repeats some of what it decided on plates
        "said": [
            *trial.history,
            *(f"{name}: {line}" for name, line in lines if not any(line in said for said in trial.history)),
        ],
        "channels": channels,
    }


def _place(about: Array) -> str:
    return f"x {format_number(about[0], 2)} m, y {format_number(about[1], 2)} m"


def _apart(value: float, above: str, below: str) -> str:
    """Return a signed distance in m as words: ``15.1 mm behind``."""
    return f"{millimetres(abs(value))} mm {above if value > 0 else below}"


def _contents(inner: str, *, replayed: bool) -> list[tuple[str, str]]:
    """Return address and title of every section of the page, of which ``inner`` holds those in the middle."""
    last = {"checks": "Quality checks", "standing": "Quiet standing", "trials": "Trials", "made": "How it was made"}
    found = re.findall(r'<section id="([^"]+)">\s*<h2>([^<]+)</h2>', inner)
    first = [(where, unescape(title)) for where, title in found]
    seen = [*(one for one in first if one[0] == "movement"), *([("replay", "Replay")] if replayed else [])]
    others = [one for one in first if one not in seen]
    return [*seen, ("figures", "Forces and masses"), *others, ("body", "The body"), *last.items()]


_SECTION = re.compile(r'<section id="(?P<id>[^"]+)">\s*(?P<title><h2>[^\n]*</h2>)(?P<rest>.*?)</section>', re.DOTALL)


def _fold(found: re.Match[str]) -> str:
    where, title, rest = found.group("id", "title", "rest")
    if where in {"verdict", "movement", "replay", "figures", "masses"}:
        return found.group()
    return f'<details class="part"><summary>{title}</summary>\n<section id="{where}">{rest}</section></details>'


def page(
    result: SessionResult,
    provenance: Row,
    *,
    attention: Sequence[Attention] | None = None,
    diagnosis: str = "",
    movement: str = "",
    replay: dict[str, Any] | None = None,
    stills: Sequence[Still] = (),
) -> str:
    """Return the page of ``result`` as HTML text; ``attention`` what a person must see (by default
    `session_attention`); ``diagnosis`` and ``movement`` the sections on what the simulation gets wrong and on what
    moved, "" for none; ``replay`` its frames in 3-D (`replay_scene`), ``stills`` some of them drawn (`stills_of`).

    The same arguments give the same characters.
    """
    from markupsafe import Markup

    said = session_attention(result) if attention is None else attention
    loud, noted = loud_and_noted(said)
    found = result.identification
    validated = {one.name: one for one in (*found.validations, *found.fitted)} if found else {}
    identified = identification_section(found) if found else ""
    whole = render(
        "page.html.j2",
        filters={"place": _place, "apart": _apart},
        schemas={"gap": GAP_ROW},
        scripts=[template_text("curves.js"), *((three_js(), template_text("replay.js")) if replay else ())],
        replay=Markup(script_json(replay)) if replay else "",
        loaded=bool(replay and replay["load"]),
        sheet=print_sheet(f"Session {result.session.folder.name}", provenance["visit"], provenance["created_utc"]),
        headline=headline_of(said),
        attention=loud,
        noted=noted,
        tiles=key_figures(result),
        contents=_contents(f"{movement}{identified}{diagnosis}", replayed=replay is not None),
        check_table=check_table(result),
        result=result,
        provenance=provenance,
        parts=[_trial_part(trial, validated.get(trial.name)) for trial in result.trials],
        standing=Markup(standing_figure(result.standing)) if result.standing else "",
        shown=Markup(still_figure(stills[0])) if stills else "",
        shown_still=stills[0] if stills else None,
        more_stills=[(Markup(still_figure(one)), one) for one in stills[1:]],
        diagnosis=Markup(diagnosis),
        movement=Markup(movement),
        identification=Markup(identified),
        words={"ok": "good", "warning": "with a note", "refused": "refused"},
    )
    return _SECTION.sub(_fold, whole)
