"""Hide everything, diagnose, judge: prints a page, or writes it, and its figure beside it, where there is none yet.

    python benchmarks/bench_diagnosis.py [--run NAME] [--minutes 30] [--out build/diagnosis.md] [--prepare]
                                        [--group null] [--sample]

Sessions are simulated and tracked once and kept on disk (`hidden_sessions.CACHE`); scores are kept per ``--run``, so
that a run that was stopped goes on, and the same command may run twice at once: every session is claimed by one of
them. ``--minutes`` ends the run early (0: only the page is made): the sessions come in an order in which every
beginning is a sample of the whole, and the page says how many there were. ``--prepare`` only simulates and tracks;
``--group`` only makes the scores of one group; ``--sample`` takes the fixed sample of `hidden_causes.sample` instead of
the whole list and writes no page but one line for every session.
"""

import argparse
import time
from pathlib import Path

from diagnosis_contamination import fault_free
from diagnosis_page import draw, page
from diagnosis_scores import Score, judged, stored
from hidden_causes import everything, sample
from hidden_sessions import Scenario, examined

from biodance.lab.plain_text import write_new


def without_culprit(scenarios: list[Scenario]) -> list[Scenario]:
    """Return the sessions that are diagnosed again with the hidden cause taken out of the family: large ones of the
    first person.
    """
    return [one for one in scenarios if one.group == "issue"]


def prepared(scenario: Scenario) -> None:
    """Simulate and track a session, and the same one without fault where masses are compared; what fails is told
    when it is judged.
    """
    try:
        examined(scenario)
        if scenario.judged:
            examined(fault_free(scenario))
    except Exception as error:
        print(f"{scenario.key} {scenario.hidden}: {type(error).__name__}: {error}", flush=True)


def main() -> None:
    """Run what time allows and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", default="now")
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--prepare", action="store_true")
    parser.add_argument("--group", default="")
    parser.add_argument("--sample", action="store_true")
    chosen = parser.parse_args()
    start, scenarios = time.monotonic(), sample() if chosen.sample else everything()
    jobs = [
        (one, absent)
        for one in scenarios
        for absent in ((False, True) if one in without_culprit(scenarios) else (False,))
    ]
    scores: list[Score] = []
    for scenario, absent in jobs:
        found = stored(scenario, chosen.run, absent=absent)
        wanted = chosen.group in ("", scenario.group)
        if found is None and wanted and time.monotonic() - start < 60 * chosen.minutes:
            if chosen.prepare:
                prepared(scenario)
                continue
            found = judged(scenario, chosen.run, absent=absent)
            if found is None:
                continue
            print(
                f"{time.monotonic() - start:6.0f} s  {found.key} {found.hidden}: {found.verdict} {found.names} "
                f"{found.note}",
                flush=True,
            )
        scores += [found] if found else []
    if not chosen.prepare and not chosen.sample and scores:
        name = "diagnosis_confusion.png"
        text = "\n".join(page(scores, run=chosen.run, figure=name, total=len(jobs))) + "\n"
        print(write_new(chosen.out, text.encode()) if chosen.out else text)
        if chosen.out:
            draw(scores, chosen.out.with_name(name))


if __name__ == "__main__":
    main()
