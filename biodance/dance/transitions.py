"""Moves between postures: first what excites, then what keeps the balance (paper eq. 18-20), rest to rest through two via points."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.chain import Chain
from biodance.dance.excitation import Blocks, dynamic_grams, dynamic_slopes, total
from biodance.dance.limits import limits
from biodance.dance.postures import free_coordinates
from biodance.dance.programme import Objective, Programme
from biodance.dance.splines import Basis, rest_to_rest
from biodance.dance.sqp import Solution, minimise
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.records import Array

RATE = 25.0
"""Hz at which limits are kept while designing."""
RESERVE = 0.05
"""Share of every limit's scale that is kept in reserve for the instants in between."""


@dataclass(frozen=True, eq=False)
class Transition:
    """``via`` (2, n) coordinates of the via points; ``gram`` (N, 6, 6) information on the inertias including the history;
    ``criterion`` sum of M_i cond(W_bi^D), kg, over the excited segments; ``zmp_before``, ``zmp_after`` m, root mean square distance of the
    zero-moment point to the middle of the support; ``violation`` of the reserved limits in their scales (feasible: at most ``RESERVE``).
    """

    via: Array
    gram: Array
    criterion: float
    zmp_before: float
    zmp_after: float
    violation: float


def excited_coordinates(chain: Chain, stance: Stance) -> list[int]:
    """Return trunk and arms with both feet down, the free leg with one (paper Table I)."""
    return chain.upper if len(stance.planted) == 2 else chain.leg_columns[1 - stance.planted[0]]


def excited_segments(chain: Chain, stance: Stance) -> list[int]:
    """Return the segments whose inertias the excited coordinates show."""
    moved = excited_coordinates(chain, stance)
    return [i for i, k in enumerate(chain.carriers) if k in moved]


def off_centre(state: State) -> tuple[float, Array]:
    """Return the mean squared distance (dm²) of the zero-moment point to the middle of the support, and its slopes."""
    wrench, slopes = state.wrench, state.wrench_slopes
    lift = wrench[:, 2:3]
    point = np.stack([-wrench[:, 4], wrench[:, 3]], axis=1) / lift
    turned = np.stack([-slopes[:, :, 4], slopes[:, :, 3]], axis=2)
    moved = (turned - point[None, :, :, None] * slopes[:, :, None, 2]) / lift[None, :, :, None]
    gap = point - state.stance.centre
    return 100 * float(np.mean(np.sum(gap**2, axis=1))), 200 / len(gap) * np.einsum("tc,ktcn->ktn", gap, moved)


def find_transition(
    chain: Chain, blocks: Blocks, stance: Stance, ends: Array, gram: Array, *, rng: np.random.Generator, duration: float = 2.0
) -> Transition:
    """Return the move between the postures ``ends`` (2, n) after the history ``gram`` (N, 6, 6).

    Where the balance cannot be kept under the exciting motion, all coordinates together look for the nearest motion that can.
    """
    basis, free = rest_to_rest(duration, rate=RATE), free_coordinates(chain, stance)
    excite, segments = excited_coordinates(chain, stance), excited_segments(chain, stance)

    def information(state: State) -> tuple[float, Array]:
        grams = gram.copy()
        grams[segments] += dynamic_grams(state, segments)
        grams += 1e-3 * np.eye(6)
        value, slope = total(blocks.weight, grams, blocks.second, segments)
        unit = float(blocks.weight[segments].sum())
        return value / unit, dynamic_slopes(state, segments, slope[segments]) / unit

    via = ends[0] + np.array([[1 / 3], [2 / 3]]) * (ends[1] - ends[0])
    via[:, excite] += rng.normal(0, 0.15, (2, len(excite)))
    first = ("ground_clearance", "joint_range", "joint_speed", "self_collision")
    via, _ = _improve(chain, stance, ends, via, excite, information, basis, first)
    before = _distance(chain, stance, ends, via, basis)
    balance = [c for c in free if c not in excite]
    names = tuple(limit.NAME for limit in limits())
    via, found = _improve(chain, stance, ends, via, balance, off_centre, basis, names)
    if found.violation > RESERVE / 2:
        via, found = _improve(chain, stance, ends, via, free, off_centre, basis, names, iterations=40)
    state = _programme(chain, stance, ends, via, [], off_centre, basis, ()).state(np.empty(0))
    whole = gram + dynamic_grams(state, list(range(len(gram))))
    value, _ = total(blocks.weight, whole, blocks.second, segments)
    return Transition(via, whole, value, before, float(np.sqrt(off_centre(state)[0]) / 10), found.violation)


def _programme(
    chain: Chain, stance: Stance, ends: Array, via: Array, free: list[int], objective: Objective, basis: Basis, names: tuple[str, ...]
) -> Programme:
    points = np.stack([ends[0], *via, ends[1]])
    points[1:3, free] = 0.0
    parts = np.stack([basis.position, basis.velocity, basis.acceleration])
    kept = tuple(limit for limit in limits() if limit.NAME in names)
    return Programme(chain, stance, parts @ points, parts[:, :, 1:3], free, kept, objective, RESERVE)


def _improve(
    chain: Chain,
    stance: Stance,
    ends: Array,
    via: Array,
    free: list[int],
    objective: Objective,
    basis: Basis,
    names: tuple[str, ...],
    *,
    iterations: int = 20,
) -> tuple[Array, Solution]:
    programme = _programme(chain, stance, ends, via, free, objective, basis, names)
    found = minimise(programme.judge, via[:, free].ravel(), iterations=iterations)
    better = via.copy()
    better[:, free] = found.y.reshape(2, -1)
    return better, found


def _distance(chain: Chain, stance: Stance, ends: Array, via: Array, basis: Basis) -> float:
    state = _programme(chain, stance, ends, via, [], off_centre, basis, ()).state(np.empty(0))
    return float(np.sqrt(off_centre(state)[0]) / 10)
