"""What acceptance changes of a session's residuals, in a process of its own: ``python -m biodance.app.residuals SESSION
ACCEPTED`` prints it as JSON.
"""

import json
import sys
from pathlib import Path
from typing import Any

from biodance.lab.session.read import read_session
from biodance.pipeline.accepted import CORRECTED
from biodance.pipeline.session import examine
from biodance.report.tables.schema import plain_values


def residual_rows(session: Path, accepted: Path) -> list[dict[str, Any]]:
    """Return by ``trial`` the RMS (6) N, N·m of measured less simulated wrench, with the table's body: ``before``, of
    the session as recorded, and ``after``, of the trials corrected in the folder of what was ``accepted``; () where
    no trial was corrected.
    """
    corrected = accepted / CORRECTED
    if not corrected.is_dir():
        return []
    before, after = _rms(session), _rms(corrected)
    return [{"trial": name, "before": rms, "after": after[name]} for name, rms in before.items() if name in after]


def _rms(folder: Path) -> dict[str, list[float]]:
    result = examine(read_session(folder))
    compared = {one.name: one.comparison for one in result.trials if one.comparison and one.comparison.used.any()}
    return {name: comparison.rms.tolist() for name, comparison in compared.items()}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(plain_values(residual_rows(Path(sys.argv[1]), Path(sys.argv[2])))))
