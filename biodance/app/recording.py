"""One recording as a window draws it: markers in three dimensions, pressures on the floor, forces and steps in time."""

from typing import Any

import numpy as np

from biodance.lab.markers.sets import read_marker_set
from biodance.lab.markers.signals import fill_gaps
from biodance.records import Array, Markers, Trial, runs
from biodance.report.pages.template import packed_numbers
from biodance.report.tables.schema import plain_values

_FRAMES = 1500
"""Frames of a trial that are drawn at most."""
_POINTS = 600
"""Points of a curve that are drawn at most."""
_LOADED = 20.0
"""N from which a plate has a centre of pressure."""


def markers_document(trial: Trial) -> dict[str, Any]:
    """Return a trial's markers to be drawn: ``names``, ``start_s``, ``step_s``, ``frames``, ``origin`` m, ``unit`` m of
    a step of ``places``, int16 (frames, markers, 3) in base64; ``gaps`` and ``filled`` spans (from, to) s by label: not
    seen, and those of them that would be filled; ``plates`` corners m.
    """
    markers = trial.markers
    if markers is None or not markers.seen.any():
        return {"names": [], "frames": 0}
    filled = _as_filled(trial, markers)
    chosen = np.arange(0, markers.time.size, max(1, -(-markers.time.size // _FRAMES)))
    xyz = filled.xyz[chosen]
    origin = np.nanmean(markers.xyz, axis=(0, 1)).round(4)
    unit = max(1e-4, float(np.nanmax(np.abs(xyz - origin))) / 30000)
    drawn = filled.filled if filled.filled.size else np.zeros(markers.seen.shape, dtype=bool)
    spans = {"gaps": ~markers.seen, "filled": drawn}
    return dict(
        plain_values(
            {
                "names": markers.names,
                "start_s": float(markers.time[0]),
                "step_s": float(np.median(np.diff(markers.time[chosen]))) if chosen.size > 1 else 0.0,
                "frames": chosen.size,
                "origin": origin,
                "unit": unit,
                "places": packed_numbers((xyz - origin) / unit),
                "plates": [plate.corners.round(4) for plate in trial.plates],
                **{key: _spans(markers, mask) for key, mask in spans.items()},
            }
        )
    )


def _as_filled(trial: Trial, markers: Markers) -> Markers:
    """Return the markers with their gaps filled as a run would fill them."""
    if not trial.marker_set:
        return fill_gaps(markers, {})[0]
    worn = read_marker_set(trial.marker_set)
    segments = {label: worn.marker(own).segment for own, label in worn.match(markers.names).items()}
    return fill_gaps(markers, segments)[0]


def _spans(markers: Markers, mask: Any) -> dict[str, list[list[float]]]:
    """Return the spans (from, to) s of each label in which ``mask`` (T, K) holds; labels without one are left out."""
    found = {
        name: [[float(markers.time[a]), float(markers.time[b - 1])] for a, b in runs(mask[:, k])]
        for k, name in enumerate(markers.names)
    }
    return {name: spans for name, spans in found.items() if spans}


def forces_document(trial: Trial) -> dict[str, Any]:
    """Return vertical force (N) of every plate over time (s) and the path of its centre of pressure (m, lab frame)."""
    rows = []
    for plate in trial.plates:
        time, force = plate.wrench.time, plate.wrench.value[:, 2]
        chosen = np.arange(0, time.size, max(1, -(-time.size // _POINTS)))
        path = plate.wrench.cop(height=plate.height, threshold=_LOADED)[chosen, :2]
        rows.append(
            {
                "name": plate.name,
                "time_s": time[chosen].round(4),
                "force_n": force[chosen].round(1),
                "cop_m": path[np.isfinite(path).all(axis=1)].round(4),
            }
        )
    return {"plates": plain_values(rows), "ends_s": _ends(trial)}


def _ends(trial: Trial) -> list[float]:
    """Return when a trial begins and ends, s."""
    clocks: list[Array] = [trial.markers.time] if trial.markers is not None else []
    clocks += [plate.wrench.time for plate in trial.plates]
    return [float(min(time[0] for time in clocks)), float(max(time[-1] for time in clocks))] if clocks else [0.0, 0.0]
