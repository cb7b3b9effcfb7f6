"""How soon a plate that changed is found, and how often one that did not is blamed; prints the table of
docs/benchmarks/plates.md.

    python benchmarks/bench_plates.py [--archives 40] [--clean 200]
"""

import argparse
from collections.abc import Callable, Iterable

import numpy as np
from plate_archives import Step, draw

from biodance.diagnosis.archive.judge import ArchiveJudgement, judge

AT = 8
"""The first visit after the step."""
AFTER = (1, 2, 3, 5, 8)
"""Visits after the step at which the archive is judged."""
STEPS = (
    Step("plate2", "place_y", 0.005, AT), Step("plate2", "place_x", 0.005, AT), Step("plate1", "place_y", 0.01, AT),
    Step("plate1", "offset_z", 5.0, AT), Step("plate2", "offset_x", -5.0, AT), Step("plate1", "offset_z", 2.5, AT),
    Step("plate1", "gain", 0.02, AT), Step("plate2", "delay", 0.008, AT),
)  # fmt: skip


def named(found: ArchiveJudgement, step: Step) -> bool:
    """Return whether the step stands on the card of its plate, and its date in the interval."""
    return any(
        change.quantity == step.quantity
        and change.plate == step.plate
        and change.earliest.name <= f"V{step.at:02d}" <= change.latest.name
        for card in found.plates
        for change in card.changes
    )


def covered(found: ArchiveJudgement, step: Step) -> list[bool]:
    """Return whether the 95 % interval of each change of the right plate and quantity holds the true size."""
    changes = {change for card in found.plates for change in card.changes}
    return [
        change.interval[0] <= step.size <= change.interval[1]
        for change in changes
        if (change.plate, change.quantity) == (step.plate, step.quantity)
    ]


def others(found: ArchiveJudgement, step: Step) -> int:
    """Return how many changes that matter are no change."""
    changes = {change for card in found.plates for change in card.changes if change.matters}
    return sum((change.plate, change.quantity) != (step.plate, step.quantity) for change in changes)


def row(step: Step, seeds: Iterable[int]) -> str:
    """Return one line of the table."""
    right: dict[int, list[bool]] = {after: [] for after in AFTER}
    inside: list[bool] = []
    wrong: list[bool] = []
    for seed in seeds:
        every = draw(seed, visits=AT + max(AFTER), step=step)
        for after in AFTER:
            found = judge([one for one in every if int(one.visit.name[1:]) < AT + after])
            right[after].append(named(found, step))
            wrong.append(others(found, step) > 0)
        inside += covered(found, step)
    shares = " | ".join(f"{100 * np.mean(right[after]):.0f}" for after in AFTER)
    about = f"{100 * np.mean(inside or [False]):.0f} | {100 * np.mean(wrong):.0f}"
    return f"| {step.plate} {step.quantity} {step.size:+g} | {shares} | {about} |"


def clean(seeds: Iterable[int], say: Callable[[str], None]) -> None:
    """Print how often an archive without fault raises an alarm."""
    alarms, strangers = [], []
    for seed in seeds:
        found = judge(draw(seed))
        alarms.append(bool(found.findings))
        strangers.append(len(found.strangers))
        if found.findings:
            say(f"<!-- seed {seed}: {found.findings[0].text} -->")
    say(f"Clean archives with an alarm: {100 * np.mean(alarms):.1f} % of {len(alarms)}; "
        f"visits or persons called unlike the others: {np.mean(strangers):.2f} an archive")  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--archives", type=int, default=40)
    parser.add_argument("--clean", type=int, default=200)
    chosen = parser.parse_args()
    print("| step | " + " | ".join(f"{a} after (%)" for a in AFTER) + " | size covered (%) | other changes (%) |")
    print("|---|" + "---|" * (len(AFTER) + 2))
    for step in STEPS:
        print(row(step, range(1000, 1000 + chosen.archives)), flush=True)
    clean(range(5000, 5000 + chosen.clean), print)


if __name__ == "__main__":
    main()
