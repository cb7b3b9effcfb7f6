"""The replay in the page: frames packed as small whole numbers, drawn by three.js and ``replay.js``; no network."""

from base64 import b64encode
from typing import Any

import numpy as np

from biodance.pipeline.session_frames import SessionReplay, TrialReplay
from biodance.records import Array
from biodance.report.figures.still import FORCE_SCALE, RESIDUAL_SCALE
from biodance.report.pages.template import script_json, template_text, three_js
from biodance.report.tables.schema import Schema

_UNKNOWN = -32768
"""Whole number of a place that is not known."""


def replay_data(found: SessionReplay) -> str:
    """Return what ``replay.js`` draws as JSON that may stand in a page.

    ``boxes`` with ``low`` and ``high`` m in the segment ``on``, ``side``; ``load`` segment and place or null; scales of
    the arrows m per N; ``trials`` with ``name``, ``frames``, ``start_s``, ``step_s``, ``worst_s``, ``origin`` m and
    ``unit`` m of a step, and int16 arrays, little-endian in base64, frame by frame: ``places`` of segments, markers,
    centre of mass and the two centres of pressure, ``turns`` (x y z w in 1/32767), ``forces`` measured, simulated and
    left in 0.1 N; ``state`` one digit a frame, `AngleState`.
    """
    scene = {
        "boxes": [
            {"on": on, "side": side, "low": low.round(4), "high": high.round(4)}
            for (low, high), on, side in zip(found.boxes, found.on, found.sides, strict=True)
        ],
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
        "places": _packed((places - origin.round(4)) / unit),
        "turns": _packed(32767 * one.rotations),
        "forces": _packed(10 * forces),
        "state": "".join(str(int(one)) for one in one.state),
    }


def _packed(values: Array) -> str:
    """Return values as whole numbers of 16 bits; what is not known or beyond them as `_UNKNOWN`."""
    known = np.isfinite(values) & (np.abs(values) < -_UNKNOWN - 0.5)
    whole = np.where(known, np.rint(np.where(known, values, 0.0)), _UNKNOWN).astype("<i2")
    return b64encode(whole.tobytes()).decode("ascii")


def replay_scripts() -> list[str]:
    """Return the scripts that the replay needs, the library first."""
    return [three_js(), template_text("replay.js")]
