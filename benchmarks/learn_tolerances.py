"""Learn what sessions without fault look like: writes biodance/diagnose/tolerances.toml anew.

    python benchmarks/learn_tolerances.py [--rounds 10] [--out biodance/diagnose/tolerances.toml]

Thirty sessions of twenty virtual persons (seeds that no other benchmark uses) are simulated and tracked once and kept on disk
(`hidden_sessions.CACHE`). Only what has a size in the tolerances in use is learned: what is not in there is no nuisance.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from hidden_sessions import Scenario, examined

from biodance.diagnose.candidates import candidates
from biodance.diagnose.learning import Null, learn, null_of
from biodance.diagnose.problem import problem
from biodance.pipeline.diagnosis import looks
from biodance.pipeline.identification import FITTED
from biodance.uncertainty.tolerances import shipped, to_toml

SCENARIOS = [Scenario("learn", i, 500 + i, 0) for i in range(20)] + [Scenario("learn", i, 500 + i, 1) for i in range(10)]


def nulls() -> Iterator[Null]:
    """Yield the sessions as `learn` wants them."""
    for scenario in SCENARIOS:
        result = examined(scenario)
        assert result.body is not None
        put = problem(result.body, looks(result.trials, FITTED))
        known = shipped()
        yield null_of(put, tuple(one for one in candidates(put) if known.knows(one.effect.name)))
        print(scenario.key, flush=True)


def main() -> None:
    """Learn and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("biodance/diagnose/tolerances.toml"))
    chosen = parser.parse_args()
    sessions = tuple(nulls())
    found = learn(sessions, shipped(), rounds=chosen.rounds)
    origin = f"{len(sessions)} virtual sessions of 20 persons without fault, realistic tolerances, protocol diagnosis"
    chosen.out.write_text(to_toml(replace(found, origin=origin)), encoding="utf-8")
    print(f"wrote {chosen.out}")


if __name__ == "__main__":
    main()
