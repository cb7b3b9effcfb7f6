"""Learn what sessions without fault look like: writes the learned rows of anthropometry/uncertainty/sizes.csv and
null_sessions.toml anew.

    python benchmarks/learn_tolerances.py [--rounds 10]

Thirty sessions of twenty virtual persons (seeds that no other benchmark uses) are simulated and tracked once and kept
on disk (`hidden_sessions.CACHE`). Only what has a size in the tolerances in use is learned: what is not in there is no
nuisance.
"""

import argparse
import csv
import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace

from hidden_sessions import Scenario, examined

from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.learning import Null, learn_tolerances, null_of
from biodance.diagnosis.problem import problem
from biodance.library import folder
from biodance.pipeline.identification import FITTED_ROLES
from biodance.pipeline.judged_trials import windows
from biodance.uncertainty.tolerances import Tolerances, shipped, to_toml

TABLES = folder("anthropometry") / "uncertainty"
SCENARIOS = [Scenario("learn", i, 500 + i, 0) for i in range(20)] + [
    Scenario("learn", i, 500 + i, 1) for i in range(10)
]


def nulls() -> Iterator[Null]:
    """Yield the sessions as `learn` wants them."""
    for scenario in SCENARIOS:
        result = examined(scenario)
        assert result.body is not None
        put = problem(result.body, windows(result.trials, FITTED_ROLES))
        known = shipped()
        yield null_of(put, tuple(one for one in candidates(put) if known.knows(one.effect.name)))
        print(scenario.key, flush=True)


def write_sizes(found: Tolerances) -> None:
    """Write the learned sizes into their rows of the one table, and its sha256 beside it."""
    table = TABLES / "sizes.csv"
    with open(table, newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        if row["learned_on"] == "null_sessions":
            row["sd"] = f"{found.size(' '.join((row['quantity'], row['target'])).removesuffix(' session')):.4g}"
    with open(table, "w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    provenance = table.with_suffix(".toml")
    fresh = hashlib.sha256(table.read_bytes()).hexdigest()
    provenance.write_text(
        re.sub('sha256 = "[0-9a-f]*"', f'sha256 = "{fresh}"', provenance.read_text()), encoding="utf-8"
    )


def main() -> None:
    """Learn and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    chosen = parser.parse_args()
    sessions = tuple(nulls())
    found = learn_tolerances(sessions, shipped(), rounds=chosen.rounds)
    origin = f"{len(sessions)} virtual sessions of 20 persons without fault, realistic tolerances, protocol diagnosis"
    write_sizes(found)
    (TABLES / "null_sessions.toml").write_text(to_toml(replace(found, origin=origin, sizes={})), encoding="utf-8")
    print(f"wrote {TABLES}")


if __name__ == "__main__":
    main()
