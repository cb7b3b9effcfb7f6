"""The end of a stream as plain values."""

from typing import Any

import numpy as np

from biodance.diagnosis.watch import LiveWarning
from biodance.pipeline.live import LiveResult
from biodance.report.documents.identification import ASKED


def live_document(found: LiveResult) -> dict[str, Any]:
    """Return the content of ``biodance live --json``: times a frame in ms (processor time of the one core that is used;
    ``wall`` by the clock, which other programs lengthen), what is known, and what was warned of.
    """
    one = found.identification
    rows = [known for known in one.known if known.quantity in ASKED] if one else []
    return {
        "frames": found.frame_s.size,
        "frames_used": int(found.fit.use.sum()) if found.fit else 0,
        "frame_ms": _spread(found.frame_s) | {"wall": _spread(found.wall_s)},
        "known": [
            {
                "segment": known.segment,
                "quantity": known.quantity,
                "unit": known.unit,
                "value": known.value,
                "sd": known.sd,
                "low": known.interval[0],
                "high": known.interval[1],
                "verdict": known.verdict,
            }
            for known in rows
        ],
        "warnings": [_warning(said) for said in found.warnings],
        "next": found.state.advice,
        "cause": found.cause,
    }


def _spread(seconds: np.ndarray) -> dict[str, float]:
    milliseconds = 1000 * seconds
    return {
        "median": float(np.median(milliseconds)),
        "p99": float(np.percentile(milliseconds, 99)),
        "longest": float(milliseconds.max()),
    }


def _warning(said: LiveWarning) -> dict[str, Any]:
    return {"time_s": said.time_s, "effect": said.effect, "target": said.target, "text": said.text}
