"""Are the three transitions that the page proposes worth more than three others? A dance danced by imprecise people,
who then repeat what is proposed for them, and three transitions drawn by chance.

    OMP_NUM_THREADS=1 python benchmarks/bench_repeat.py DANCE.npz [PERFORMERS [FIRST]]

Gain: by how much the share of the table's variance removed grows, mean over the segments, of the repetition as it is
danced (other errors, other tempo). Every performer draws five triples; the first is the one that is compared.
"""

import sys
from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.expectation import posterior_after, shares, typical_noise
from biodance.dance.imprecision import USUAL_IMPRECISION, PlannedDance, draw_clock
from biodance.dance.scoring import Worth, score_performance, worth_of
from biodance.motion.regressor import predict_wrench
from biodance.motion.smoothing import smooth
from biodance.records import Array, Motion
from biodance.uncertainty.noise import Noise

RATE, TRIPLES = 25.0, 5


def danced(plan: PlannedDance, start: float, end: float, seed: list[int]) -> Motion:
    """Return how a performer dances the plan between two instants."""
    coarse, when = draw_clock(np.random.default_rng([*seed, 7]), end - start, USUAL_IMPRECISION)
    time = np.arange(round(coarse[-1] * RATE) + 1) / RATE
    there = start + np.interp(time, coarse, when)
    copy = plan.performed_by(((np.random.default_rng([*seed, 8]), time, there, slice(None)),), USUAL_IMPRECISION)
    return smooth(plan.dance.body, time, copy.q)


def gained(plan: PlannedDance, known: Worth, moves: tuple[int, ...], noise: Noise, seed: list[int]) -> float:
    """Return what repeating the transitions to the postures ``moves`` gains beside what is ``known``."""
    body, phases = plan.dance.body, {p.posture: p for p in plan.dance.phases if p.kind == "move"}
    more = known
    for p in moves:
        more = more + worth_of(body, danced(plan, phases[p].start, phases[p].end, [*seed, p]), noise=noise)
    return float((_share(plan, more) - _share(plan, known)).mean())


def _share(plan: PlannedDance, known: Worth) -> Array:
    return shares(posterior_after(plan.dance.body, known.H, known.disturbed))


def main(path: str, performers: str = "20", first: str = "0") -> None:
    """Print a row a performer, from number ``first`` on, and how many gain more from what is proposed."""
    dance = Dance.load(Path(path))
    plan, body = PlannedDance(dance), dance.body
    noise = typical_noise(predict_wrench(body, dance.motion(12.5)))
    free = [
        p.posture
        for p in dance.phases
        if p.kind == "move" and np.array_equal(dance.stances[p.posture - 1].ankle, dance.stances[p.posture].ankle)
    ]
    better = mean_better = 0
    print("| performer | proposed | gain, % | three by chance, % | mean of five triples, % |\n|" + "---|" * 5)
    for k in range(int(first), int(first) + int(performers)):
        motion = danced(plan, 0.0, dance.duration, [0, k])
        found = score_performance(dance, body, ((motion, np.ones(motion.time.size, dtype=bool)),))
        known, rng = worth_of(body, motion, noise=noise), np.random.default_rng([1, k])
        mine = 100 * gained(plan, known, found.repeat, noise, [2, k])
        others = [
            100 * gained(plan, known, tuple(rng.choice(free, 3, replace=False).tolist()), noise, [3, k, t])
            for t in range(TRIPLES)
        ]
        better, mean_better = better + (mine > others[0]), mean_better + (mine > np.mean(others))
        proposed = ", ".join(map(str, found.repeat))
        print(f"| {k} | {proposed} | {mine:.2f} | {others[0]:.2f} | {np.mean(others):.2f} |", flush=True)
    print(f"more than three by chance: {better} of {performers}; than their mean: {mean_better} of {performers}")


if __name__ == "__main__":
    main(*sys.argv[1:])
