"""The design's own SQP against a library's on the same problems: static postures of a person, all limits, exact slopes.

    python benchmarks/bench_sqp.py [--starts 24]

Each start is solved by `nlp.minimise` (quadratic steps by non-negative least squares) and by SciPy's SLSQP with the
same objective, margins and slopes, and the quadratic programme of a first step by `nlp.quadratic_step` and by clarabel.
Processor times, one process.
"""

import argparse
import time
import warnings

import clarabel
import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csc_matrix

from biodance.body.human.human import human
from biodance.dance.limits import family
from biodance.dance.postures.posture import KEPT, Exciting, initial_guess
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import excitation_blocks, static_grams
from biodance.dance.problem.nlp import WEIGHT, NonlinearProgramme, free_coordinates, minimise, quadratic_step
from biodance.dance.problem.stance import stance
from biodance.records import Array, Subject

ITERATIONS, RADIUS = 30, 0.3


def problem_at(chain: Chain, seed: int) -> tuple[NonlinearProgramme, Array]:
    """Return the problem of one posture beside nine random directions of gravity, and its start."""
    rng = np.random.default_rng(seed)
    feet = stance(chain.body, "parallel", share=0.6)
    begin, free = initial_guess(chain, feet, rng), free_coordinates(chain, feet)
    up = rng.normal(size=(9, len(chain.body.segments), 3))
    parts = excitation_blocks(chain.body)
    objective = Exciting(
        parts, static_grams(up / np.linalg.norm(up, axis=2, keepdims=True)), 0.01 * parts.weight.sum(), 8
    )
    base = np.zeros((3, 1, chain.size))
    base[0, 0] = begin
    base[0, 0, free] = 0.0
    kept = tuple(limit for limit in family() if limit.at_rest)
    reserve = np.array([[limit.hold_reserve(feet) for limit in kept]])
    basis = np.array([1.0, 0.0, 0.0])[:, None, None]
    return NonlinearProgramme(chain, feet, base, basis, free, kept, objective, reserve), begin[free]


def by_scipy(problem: NonlinearProgramme, start: Array) -> tuple[Array, int]:
    """Return what SLSQP finds and how often it asked for the problem."""
    seen: dict[bytes, object] = {}

    def at(y: Array) -> object:
        return seen.setdefault(y.tobytes(), problem.evaluate(y.copy()))

    rows = np.arange(problem.evaluate(start).margins.size)
    inequality = {"type": "ineq", "fun": lambda y: at(y).margins, "jac": lambda y: at(y).slopes(rows)[1]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = minimize(
            lambda y: (at(y).value, at(y).slopes(rows[:0])[0]),
            start,
            jac=True,
            method="SLSQP",
            constraints=[inequality],
            options={"maxiter": ITERATIONS},
        )
    return found.x, len(seen)


def by_clarabel(gradient: Array, jacobian: Array, margins: Array) -> Array:
    """Return the step of the same quadratic programme as `quadratic_step` with the identity as Hessian."""
    n = gradient.size
    P, q = csc_matrix(np.eye(n + 1)), np.append(gradient, 1.0)
    rows = [
        np.column_stack([-jacobian, np.full(len(jacobian), -1 / WEIGHT)]),
        np.eye(n, n + 1),
        -np.eye(n, n + 1),
        -np.eye(n + 1)[-1:],
    ]
    bounds = np.concatenate([margins, np.full(2 * n, RADIUS), [0.0]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    A = csc_matrix(np.vstack(rows))
    return np.array(
        clarabel.DefaultSolver(P, q, A, bounds, [clarabel.NonnegativeConeT(len(bounds))], settings).solve().x
    )[:n]


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--starts", type=int, default=24)
    chain = Chain(human(Subject(65.0, 1.75, "F", 33.0)))
    rows, steps = [], []
    for seed in range(parser.parse_args().starts):
        problem, start = problem_at(chain, seed)
        problem.evaluate(start).slopes(np.arange(1))
        began = time.process_time()
        ours = minimise(problem.evaluate, start, iterations=ITERATIONS)
        between = time.process_time()
        y, asked = by_scipy(problem, start)
        after = time.process_time()
        theirs = problem.evaluate(y)
        rows.append(
            (between - began, ours.violation, ours.value, after - between, -theirs.margins.min(), theirs.value, asked)
        )
        point = problem.evaluate(start)
        near = np.flatnonzero(point.margins < 1.5)
        gradient, jacobian = point.slopes(near)
        for solve in (
            lambda g=gradient, J=jacobian, m=point.margins[near]: quadratic_step(np.eye(len(g)), g, J, m, RADIUS)[0],
            lambda g=gradient, J=jacobian, m=point.margins[near]: by_clarabel(g, J, m),
        ):
            steps.append(solve())
    table = np.array(rows)
    for name, (seconds, violation, value) in (("own SQP", table[:, :3].T), ("SLSQP", table[:, 3:6].T)):
        kept = violation <= KEPT
        print(
            f"{name}: {1e3 * np.mean(seconds):.0f} ms a start, {kept.sum()} of {len(kept)} feasible, median "
            f"{np.median(value[kept]):.4f}"
        )
    both = (table[:, 1] <= KEPT) & (table[:, 4] <= KEPT)
    print(
        f"objective where both are feasible ({both.sum()}): {np.mean(table[both, 2]):.4f} and "
        f"{np.mean(table[both, 5]):.4f}"
    )
    gaps = [float(np.abs(a - b).max()) for a, b in zip(steps[::2], steps[1::2], strict=True)]
    print(f"one quadratic step, largest difference to clarabel: median {np.median(gaps):.1e}, worst {max(gaps):.1e}")
    timed(chain)


def timed(chain: Chain) -> None:
    """Print what one quadratic step costs by either solver."""
    problem, start = problem_at(chain, 0)
    point = problem.evaluate(start)
    near = np.flatnonzero(point.margins < 1.5)
    gradient, jacobian = point.slopes(near)
    for name, solve in (
        ("own", lambda: quadratic_step(np.eye(len(gradient)), gradient, jacobian, point.margins[near], RADIUS)),
        ("clarabel", lambda: by_clarabel(gradient, jacobian, point.margins[near])),
    ):
        began = time.process_time()
        for _ in range(50):
            solve()
        print(
            f"one quadratic step of {len(gradient)} unknowns, {len(near)} margins, {name}: "
            f"{20 * (time.process_time() - began):.2f} ms"
        )


if __name__ == "__main__":
    main()
