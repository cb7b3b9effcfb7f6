"""The shortest vector that keeps matrices positive semidefinite and distances positive: one programme, by Clarabel.

A programme of a few segments is written in the solver's own form, least x' P x / 2 + q' x with b - A x in a product of
cones (Goulart and Chen 2024, arXiv:2405.12762): cvxpy, which writes larger ones (`paper_programme`), takes a third of a
second to load.
"""

from collections.abc import Sequence

import numpy as np

from biodance.records import Array

SOLVED = "optimal"
"""The word for an answer that may be used."""
_WORDS = {"Solved": SOLVED, "AlmostSolved": "optimal_inaccurate", "PrimalInfeasible": "infeasible"}
"""The solver's words, as cvxpy says them."""


def shortest_inside(matrices: Sequence[tuple[Array, Array]], slope: Array, level: Array) -> tuple[Array | None, str]:
    """Return argmin |z|² (k,) and "optimal", or None and what the solver ran into.

    Every M z + m of ``matrices`` (M (n, n, k) and m (n, n), symmetric) is positive semidefinite, ``slope`` (q, k) z +
    ``level`` (q,) nowhere negative.
    """
    import clarabel
    from scipy.sparse import csc_matrix, eye_array

    count = slope.shape[1]
    rows, right, cones = [-slope], [level], [clarabel.NonnegativeConeT(len(level))]
    for M, m in matrices:
        j, i = np.tril_indices(len(m))  # the upper triangle, column by column
        weight = np.where(i == j, 1.0, np.sqrt(2.0))
        rows.append(-weight[:, None] * M[i, j])
        right.append(weight * m[i, j])
        cones.append(clarabel.PSDTriangleConeT(len(m)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    twice = csc_matrix(2.0 * eye_array(count))
    A, b = csc_matrix(np.concatenate(rows)), np.concatenate(right)
    found = clarabel.DefaultSolver(twice, np.zeros(count), A, b, cones, settings).solve()
    word = _WORDS.get(str(found.status), str(found.status))
    return (np.array(found.x) if word == SOLVED else None), word
