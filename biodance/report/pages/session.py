"""The analyst's page: one HTML file that holds all it shows and asks nothing of the network.

First what a person needs, on two printed pages: the verdict, what needs somebody, mass and key figures, the body; then,
folded, everything by trial.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import unescape
from typing import Any

import numpy as np

from biodance.identification.validation import TrialValidation
from biodance.pipeline.attention import session_attention
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import Provenance
from biodance.pipeline.still import SessionReplay, TrialReplay
from biodance.pipeline.trial_result import Check, TrialResult
from biodance.records import CHANNELS, AngleState, Array
from biodance.records.attention import Attention
from biodance.report.figures.session import (
    FORCE_SCALE,
    RESIDUAL_SCALE,
    marker_figure,
    standing_figure,
    still_figure,
    validation_figure,
    wrench_figure,
)
from biodance.report.pages.identification import identification_section
from biodance.report.pages.template import packed_numbers, print_sheet, render, script_json, template_text, three_js
from biodance.report.tables.schema import Row, Schema
from biodance.report.tables.session import GAP_ROW
from biodance.report.wording import format_number, headline_of, loud_and_noted, millimetres


def replay_data(found: SessionReplay) -> str:
    """Return what ``replay.js`` draws as JSON that may stand in a page.

    ``boxes`` with ``low`` and ``high`` m in the segment ``on``, ``side``; ``load`` segment and place or null; scales of
    the arrows m per N; ``trials`` with ``name``, ``frames``, ``start_s``, ``step_s``, ``worst_s``, ``origin`` m and
    ``unit`` m of a step, and int16 arrays, little-endian in base64, frame by frame: ``places`` of segments, markers,
    centre of mass and the two centres of pressure, ``turns`` (x y z w in 1/32767), ``forces`` measured, simulated and
    left in 0.1 N; ``state`` one digit a frame, `AngleState`.
    """
    boxes = zip(found.boxes.round(4), found.on, found.sides, strict=True)
    scene = {
        "boxes": [{"on": on, "side": side, "low": low, "high": high} for (low, high), on, side in boxes],
        "load": None if found.load is None else {"on": found.load[0], "place": found.load[1].round(4)},
        "force_scale": FORCE_SCALE,
        "residual_scale": RESIDUAL_SCALE,
        "trials": [_trial(one) for one in found.trials],
    }
    return script_json(scene)


def _trial(one: TrialReplay) -> dict[str, Any]:
    places = np.concatenate(
        [one.positions, one.markers, one.com[:, None], one.measured[:, 1:], one.simulated[:, 1:]], axis=1
    )
    origin = np.nanmean(one.com, axis=0)
    # whole numbers of 16 bits: the segment furthest from the origin is at most 30,000 steps away
    unit = max(1e-4, float(np.nanmax(np.abs(one.positions - origin))) / 30000)
    forces = np.stack([one.measured[:, 0], one.simulated[:, 0], one.residual], axis=1)
    return {
        **Schema("name parameters frames=#time worst_s=worst").row(one),
        "segments": one.positions.shape[1],
        "markers": one.markers.shape[1],
        "start_s": float(one.time[0]),
        "step_s": float(one.time[-1] - one.time[0]) / max(one.time.size - 1, 1),
        "plates": one.plates.round(4),
        "origin": origin.round(4),
        "unit": unit,
        "places": packed_numbers((places - origin.round(4)) / unit),
        "turns": packed_numbers(32767 * one.rotations),
        "forces": packed_numbers(10 * forces),
        "state": "".join(str(int(one)) for one in one.state),
    }


STATUS_WORDS = {"ok": "done", "warning": "look here", "refused": "refused"}


def check_table(result: SessionResult) -> tuple[list[tuple[str, str]], list[tuple[TrialResult, list[Check | None]]]]:
    """Return the trials' checks as a table: its columns (what, limit), and per trial one check or None a column."""
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
        declared = result.declared_mass
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
        gain = f"{format_number(one.gain.force, 2)} times closer on kept trials" if one.gain else "gain not proven"
        value = f"{masses.count('known')} known, {masses.count('partly known')} partly"
        tiles.append(Tile(f"Masses of {len(masses)} segments", value, gain))
    return tiles


@dataclass(frozen=True)
class TrialPart:
    """One trial with its figures as HTML; "" where there is nothing to draw."""

    result: TrialResult
    markers: str
    wrench: str
    validation: TrialValidation | None = None

    @property
    def gaps(self) -> list[Row]:
        """The markers with a gap, the worst first."""
        return GAP_ROW.rows(sorted((gap for gap in self.result.gaps if gap.percent > 0), key=lambda gap: -gap.percent))

    @property
    def said(self) -> list[str]:
        """What was decided when the trial was read and prepared, each sentence once."""
        trial = self.result.trial
        lines = ((plate.name, line) for plate in trial.plates for line in plate.decisions)
        # a reader's history repeats some of what it decided on plates
        told = [f"{name}: {line}" for name, line in lines if not any(line in said for said in trial.history)]
        return [*trial.history, *told]

    @property
    def channels(self) -> list[tuple[str, str, float, float]]:
        """Channel, unit, RMS and correlation of the wrench comparison; no correlation where nobody moves."""
        comparison = self.result.comparison
        if comparison is None:
            return []
        units = ("N",) * 3 + ("N·m",) * 3
        alike = [math.nan] * 6 if self.result.trial.role == "static" else comparison.correlation.tolist()
        return list(zip(CHANNELS, units, comparison.rms.tolist(), alike, strict=True))


def _trial_part(result: TrialResult, validated: Mapping[str, TrialValidation]) -> TrialPart:
    name = result.trial.name
    filled = None if result.motion is None else result.motion.frame_state == AngleState.FILLED
    if name in validated:
        wrench = validation_figure(validated[name], filled=filled)
    else:
        wrench = wrench_figure(result.comparison, name, filled=filled) if result.comparison else ""
    return TrialPart(result, marker_figure(result.fit) if result.fit else "", wrench, validated.get(name))


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


_UNFOLDED = {"verdict", "movement", "replay", "figures", "masses"}
_SECTION = re.compile(r'<section id="(?P<id>[^"]+)">\s*(?P<title><h2>[^\n]*</h2>)(?P<rest>.*?)</section>', re.DOTALL)


def _fold(found: re.Match[str]) -> str:
    where, title, rest = found.group("id", "title", "rest")
    if where in _UNFOLDED:
        return found.group()
    return f'<details class="part"><summary>{title}</summary>\n<section id="{where}">{rest}</section></details>'


def page(
    result: SessionResult,
    provenance: Provenance,
    *,
    attention: Sequence[Attention] | None = None,
    diagnosis: str = "",
    movement: str = "",
    replay: SessionReplay | None = None,
) -> str:
    """Return the page of ``result`` as HTML text; ``attention`` what a person must see (by default
    `session_attention`); ``diagnosis`` and ``movement`` the sections on what the simulation gets wrong and on what
    moved, "" for none; ``replay`` its frames in 3-D.

    The same arguments give the same characters.
    """
    from markupsafe import Markup

    said = session_attention(result) if attention is None else attention
    loud, noted = loud_and_noted(said)
    found = result.identification
    validated = {one.name: one for one in (*found.validations, *found.fitted)} if found else {}
    identified = identification_section(found) if found else ""
    worst = result.more_stills[0] if result.more_stills else result.still
    others = [still for still in (result.still, *result.more_stills) if still is not None and still is not worst]
    whole = render(
        "page.html.j2",
        filters={"place": _place, "apart": _apart},
        schemas={"gap": GAP_ROW},
        scripts=[template_text("curves.js"), *((three_js(), template_text("replay.js")) if replay else ())],
        replay=Markup(replay_data(replay)) if replay else "",
        loaded=bool(replay and replay.load),
        sheet=print_sheet(f"Session {result.session.folder.name}", provenance.visit, provenance.created),
        headline=headline_of(said),
        attention=loud,
        noted=noted,
        tiles=key_figures(result),
        contents=_contents(f"{movement}{identified}{diagnosis}", replayed=replay is not None),
        check_table=check_table(result),
        result=result,
        provenance=provenance,
        parts=[_trial_part(trial, validated) for trial in result.trials],
        standing=Markup(standing_figure(result.standing)) if result.standing else "",
        shown=Markup(still_figure(worst)) if worst else "",
        shown_still=worst,
        more_stills=[(Markup(still_figure(one)), one) for one in others],
        diagnosis=Markup(diagnosis),
        movement=Markup(movement),
        identification=Markup(identified),
        words=STATUS_WORDS,
    )
    return _SECTION.sub(_fold, whole)
