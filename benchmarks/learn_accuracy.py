"""Learn how far the sizes of named causes are from the truth: writes [accuracy] of
anthropometry/uncertainty/null_sessions.toml anew.

    python benchmarks/learn_accuracy.py [--minutes 30] [--out anthropometry/uncertainty/null_sessions.toml] [--prepare]

Every cause at three times its limit is hidden in sessions of two persons whom no other benchmark uses. No real fault is
quite like the model that is fitted to it (a joint's course, a rope's angle), so a size errs by a share of itself,
beyond what noise explains. The share of an effect is that of its own sessions and, counted once, of all; widened as
Student's t is, since there are few. What was measured is kept (`hidden_sessions.CACHE`, folder accuracy: remove it when
the diagnosis changes), and two processes may run at once: the last writes.
"""

import argparse
import json
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
from diagnosis_scores import claimed, measured
from hidden_causes import LEVELS, SINGLE, truth
from hidden_sessions import CACHE, Scenario, examined
from scipy.stats import t as student

from biodance.identification.knowledge import SIGMAS
from biodance.pipeline.diagnosis import diagnose_session
from biodance.uncertainty.tolerances import read_tolerances, shipped, to_toml

PERSONS = (10, 11)
FILTER = "filter_mismatch:cutoff=4"


def scenarios() -> list[Scenario]:
    """Return the sessions to learn from."""
    texts = [*(cause.text(LEVELS["above"] * cause.limit) for cause in SINGLE), FILTER]
    return [Scenario("accuracy", person, 800 + person, hidden=(text,)) for text in texts for person in PERSONS]


def kept(scenario: Scenario) -> Path:
    """Return where the size found in a session is kept."""
    return CACHE / "accuracy" / f"{scenario.key}.json"


def measure(scenario: Scenario) -> None:
    """Diagnose a session and keep effect, size found, its standard deviation without accuracy, and the true size;
    nulls if not named.
    """
    path = kept(scenario)
    if path.is_file() or not claimed(path):
        return
    (same,) = truth(scenario)
    findings = diagnose_session(examined(scenario), tolerances=replace(shipped(), accuracy={})).diagnosis.findings
    found = measured(scenario, findings, same)
    effect = next((f.effect for f in findings if (f.effect, f.target) in same), "")
    part = path.with_suffix(".part")
    part.write_text(json.dumps({"effect": effect, "hidden": scenario.hidden[0], "found": found}))
    part.replace(path)
    path.with_suffix(".claim").unlink(missing_ok=True)
    print(scenario.hidden[0], found, flush=True)


def shares(rows: list[tuple[str, float, float, float]]) -> dict[str, float]:
    """Return the accuracy of every effect, and the median for "other" ones, from rows of effect, size found, its sd
    and true size.
    """
    excess = defaultdict(list)
    for effect, value, sd, true in rows:
        excess[effect].append(max(0.0, (value - true) ** 2 - sd**2) / value**2)
    pooled = float(np.median([np.mean(some) for some in excess.values()]))
    wide = {effect: student.ppf(0.975, len(some) + 1) / SIGMAS for effect, some in excess.items()}
    found = {
        effect: float(wide[effect] * np.sqrt((pooled + sum(some)) / (len(some) + 1)))
        for effect, some in sorted(excess.items())
    }
    return {**found, "other": float(np.median(list(found.values())))}


def main() -> None:
    """Measure what time allows, learn and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--out", type=Path, default=Path("anthropometry/uncertainty/null_sessions.toml"))
    parser.add_argument("--prepare", action="store_true", help="only simulate and track")
    chosen = parser.parse_args()
    start = time.monotonic()
    for scenario in scenarios():
        if time.monotonic() - start < 60 * chosen.minutes:
            (examined if chosen.prepare else measure)(scenario)
    if chosen.prepare:
        return
    found = [json.loads(path.read_text()) for path in map(kept, scenarios()) if path.is_file()]
    rows = [(one["effect"], *one["found"]) for one in found if one["found"]]
    known = read_tolerances(chosen.out.read_text(encoding="utf-8"))
    chosen.out.write_text(to_toml(replace(known, accuracy=shares(rows))), encoding="utf-8")
    print(f"wrote {chosen.out}: {len(rows)} sizes of {len(found)} sessions")


if __name__ == "__main__":
    main()
