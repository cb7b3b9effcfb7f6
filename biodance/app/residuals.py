"""What plates and simulation of a session differ by before and after something is corrected, in a process of its own:
``python -m biodance.app.residuals SESSION ACCEPTED`` prints it as JSON.
"""

import json
import sys
from pathlib import Path
from typing import Any

from biodance.lab.session.read import read_session
from biodance.pipeline.accepted import CORRECTED
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.report.tables.schema import plain_values


def residual_rows(before: SessionResult, after: SessionResult) -> list[dict[str, Any]]:
    """Return by ``trial`` the RMS of a session ``before`` and ``after`` a correction, each a list: the six channels of
    measured less simulated wrench (N, N·m; the table's body), and the distance of the markers from the body (mm); None
    = not known.
    """
    rows, later = _rms(before), _rms(after)
    return [{"trial": name, "before": rms, "after": later[name]} for name, rms in rows.items() if name in later]


def _rms(result: SessionResult) -> dict[str, list[float | None]]:
    found: dict[str, list[float | None]] = {}
    for one in result.trials:
        compared = one.comparison is not None and one.comparison.used.any()
        wrench = one.comparison.rms.tolist() if compared and one.comparison else [None] * 6
        if compared or one.fit:
            found[one.name] = [*wrench, 1000 * one.fit.total_rms if one.fit else None]
    return found


if __name__ == "__main__":
    corrected = Path(sys.argv[2]) / CORRECTED
    pair = [examine(read_session(folder)) for folder in (Path(sys.argv[1]), corrected)] if corrected.is_dir() else []
    sys.stdout.write(json.dumps(plain_values(residual_rows(*pair) if pair else [])))
