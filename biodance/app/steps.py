"""What session.toml's events change of a trial's spatio-temporal values, in a process of its own: ``python -m
biodance.app.steps RESULTS SESSION TRIAL STEM`` prints it as JSON. The motion is the last run's; nothing is tracked.
"""

import json
import sys
from pathlib import Path
from typing import Any

from biodance.cycles.cut import gait_cycles, is_left_out, replaced_events
from biodance.cycles.strides import STRIDE_UNITS, mean_values, strides
from biodance.errors import BiodanceError
from biodance.lab.session.file import read_session_file
from biodance.library import parse_json
from biodance.motion.kinematics import centre_of_mass
from biodance.motion.soles import soles_from_body
from biodance.pipeline.saved_results import read_kept
from biodance.records import FootEvent
from biodance.report.tables.schema import plain_values

_OF_MASSES = ("margin_aside", "margin_ahead", "vertical_stiffness")
"""Values that rest on masses: the body that is kept has identified ones, the last run's values those of the table."""


def stride_rows(results: Path, session: Path, trial: str, stem: str) -> list[dict[str, Any]]:
    """Return the spatio-temporal values of a ``trial`` (file ``stem``), but `_OF_MASSES`, by ``quantity``, ``unit`` and
    ``side``: ``before``, the mean of the last run, in ``results``, and ``after`` over ``count`` strides, with the
    events and the spans left out that the session.toml of the ``session`` says now; None = no value.

    Raises
    ------
    BiodanceError
        The last run gave no motion of the trial, or found the events of a foot by hand that session.toml says no more.
    """
    document = parse_json((results / "results.json").read_text(encoding="utf-8"))
    moved = [one for one in (document["movement"] or {"trials": []})["trials"] if one["trial"] == trial]
    kept = read_kept(results)
    if not moved or trial not in kept.motions:
        raise BiodanceError(f"Trial {trial}: the last run gave no motion of it. Run the session again.")
    told = read_session_file(session).parts(stem)
    found = tuple(FootEvent(e["time_s"], e["side"], e["down"], e["source"]) for e in moved[0]["events"])
    gone = {one.side for one in found if one.source == "hand"} - {one.side for one in told.events}
    if gone:
        raise BiodanceError(
            f"Trial {trial}: in the last run the events of the {' and '.join(sorted(gone))} foot were set by hand, and "
            f"now they are not. Run the session again to have them found."
        )
    motion, events = kept.motions[trial], replaced_events(found, told.events)
    cycles = [one for one in gait_cycles(trial, events) if not is_left_out(one, told.left_out)]
    soles, centre = soles_from_body(kept.body, motion), centre_of_mass(kept.body, motion)
    some = strides(cycles, events, kept.body, soles, centre)
    before = {(one["quantity"], one["side"]): one["mean"] for one in moved[0]["spatiotemporal"]}
    after = {side: mean_values(some, side) for side in ("left", "right")}
    return [
        {"quantity": name, "unit": unit, "side": side, "before": before.get((name, side))}
        | dict(zip(("after", "sd", "count"), after[side].get(name, (None, None, 0)), strict=True))
        for name, unit in STRIDE_UNITS.items()
        if name not in _OF_MASSES
        for side in ("left", "right")
        if (name, side) in before or name in after[side]
    ]


if __name__ == "__main__":
    try:
        rows = stride_rows(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4])
    except BiodanceError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(2)
    sys.stdout.write(json.dumps(plain_values(rows)))
