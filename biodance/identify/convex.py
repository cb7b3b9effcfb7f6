"""Convex programmes: solved, or a word why not; an answer that the solver itself calls inaccurate is none."""

import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import cvxpy as cp


def solve_convex(problem: "cp.Problem") -> str:
    """Solve ``problem`` in place and return "optimal", or the solver's word for what it ran into: then no value is to be used."""
    import cvxpy as cp

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that an answer is inaccurate is said by the word
            problem.solve(solver=cp.CLARABEL, ignore_dpp=True)
    except cp.error.SolverError as error:
        return str(error).split(". ")[0]
    return str(problem.status)
