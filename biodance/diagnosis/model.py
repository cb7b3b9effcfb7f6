"""The problem under its tolerances: whitened rows, and columns of all that is no fault."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.candidates import SCALE, Candidate, candidates
from biodance.diagnosis.problem import Problem
from biodance.discovery import Chosen
from biodance.effects import Effect, effects
from biodance.lab.markers.sets import part_of
from biodance.motion.kinematics import chains
from biodance.records import Array
from biodance.uncertainty.sources import joint_of
from biodance.uncertainty.tolerances import HABIT, Tolerances, in_state, key_of, mean_key, whitened


def white(problem: Problem, tolerances: Tolerances, rows: Array, *, out: Array | None = None) -> Array:
    """Return ``rows`` (r, n) of the problem in units of their standard deviation, in ``out`` or a new array."""
    where = problem.spectrum
    return whitened(rows, where.band, marker_keys(problem), problem.mass, tolerances, loud=where.loud, out=out)


def marker_keys(problem: Problem) -> tuple[str, ...]:
    """Return the keys of the rows that follow those of the plates."""
    body = problem.cases[0].body
    wholes = (*range(len(body.segments)), *(part.segment for part in body.parts))
    keys = tuple(f"marker {part_of(body.segments[wholes[s]])}" for s in body.markers.segment for _ in range(3))
    return keys + tuple(f"shown {name}" for name, _ in problem.shown)


@dataclass(frozen=True, eq=False)
class Nuisances:
    """All that may be no fault: ``parts`` (r, k) of the columns (r, K), which times ``scale`` (K,) are per unit; the
    ``keys`` (K) of their sizes and ``means`` (K) of their means ("" for those that have none: the signs of slides and
    tilts are mirrored between sides and persons); ``causes`` by effect and target: its columns, and (p, k) what one
    unit of each is in its parameters.
    """

    parts: tuple[NDArray[np.floating], ...]
    scale: Array
    keys: tuple[str, ...]
    means: tuple[str, ...]
    causes: Mapping[tuple[str, str], tuple[slice, Array]]


def nuisances(problem: Problem, causes: tuple[Candidate, ...]) -> Nuisances:
    """Return the kinematic errors of a problem and the ``causes`` that are tolerances."""
    body = problem.cases[0].body
    joints = {joint_of(body, chain) for chain in chains(body)}
    parts: list[NDArray[np.floating]] = [problem.kinematics]
    keys, scale = list(problem.groups), [1.0] * problem.kinematics.shape[1]
    means = [group if group.startswith("sag ") else "" for group in problem.groups]
    tolerated = {}
    for one in causes:
        parts.append(one.basis)
        key, width = key_of(*one.names), one.basis.shape[1]
        tolerated[one.names] = slice(len(keys), len(keys) + width), one.units
        # A basis is per SCALE typical sizes: back to one unit of the first parameter.
        scale += [1 / (SCALE * one.effect.typical[0])] * width
        own = in_state(key, one.effect.target if one.effect.target in joints else "", body)
        loud = [p.name for p, silent in zip(one.effect.parameters, one.silent, strict=True) if not silent]
        keys += [own] * width
        means += [mean_key(*one.names, name) if own == key else "" for name in loud] + [""] * (width - len(loud))
        if one.names in problem.shown:
            # In the rows of sizes shown what everybody does by habit is taken off already (`Effect.shown`).
            habit = np.array(one.basis)
            habit[len(habit) - len(problem.shown) :] = 0.0
            parts.append(habit)
            scale += scale[-width:]
            keys += [HABIT + key] * width
            means += [""] * width
    return Nuisances(tuple(parts), np.array(scale), tuple(keys), tuple(means), tolerated)


def shown_left_out(expected: Array, marker_keys: tuple[str, ...]) -> Array:
    """Return ``expected`` (r,) with zero in the rows of sizes shown: what everybody shows is taken off there
    already.
    """
    shown = [key.startswith("shown ") for key in marker_keys]
    return np.concatenate(
        [expected[: len(expected) - len(shown)], np.where(shown, 0.0, expected[len(expected) - len(shown) :])]
    )


def causes_of(problem: Problem, tolerances: Tolerances, chosen: Chosen[Effect]) -> tuple[Candidate, ...]:
    """Return all causes to search for, and those that are not searched for but keep their tolerance."""
    family = effects(chosen)
    return candidates(
        problem, {n: one for n, one in {**effects(), **family}.items() if n in family or tolerances.knows(n)}
    )
