"""What tapes can tell about masses at all: a predictor that learned the generator of people itself, against our solids.

    python benchmarks/girths_limit.py [people 8000] [tested 100] [first seed 501]

The predictor sees what identification sees beforehand (sex, stature, body mass, lengths wrong by 5 mm) and girths, and
learns the logarithms of the masses of thousands of generated people (`generated_people.py`) from all terms of first and
second degree, least squares with a ridge chosen on a fifth of them kept apart. It knows the laws by which these people
were drawn, which nobody knows of real people: what it leaves is what tapes cannot see (density, cuts, hands, sides), a
floor for every honest prior. It is tested on people whom it has not seen, those of `bench_girths.py`.
"""

import sys
from collections.abc import Callable

import numpy as np
from bench_girths import _FEW, _KINDS, compare
from generated_people import _SLICES, GeneratedPerson, generate_person, section_edge

from biodance.body.human.skeleton import SEGMENTS, kind_of
from biodance.records import Array

_PARTS = ("thigh", "shank", "upper_arm", "forearm", "lower_trunk", "upper_trunk", "head")
_FIRST = 100_000
"""Seed of the first person learned from."""
_RIDGES = 10.0 ** np.arange(-6.0, 2.0)
Sees = Callable[[GeneratedPerson, np.random.Generator], list[float]]


def few(person: GeneratedPerson, rng: np.random.Generator) -> list[float]:
    """Return the logarithms of the seven girths."""
    return [float(np.log(person.girths[name])) for name in _FEW]


def usual(person: GeneratedPerson, rng: np.random.Generator) -> list[float]:
    """Return the logarithms of the fourteen girths."""
    return [float(np.log(girth)) for girth in person.girths.values()]


def dense(person: GeneratedPerson, rng: np.random.Generator) -> list[float]:
    """Return the logarithms of girths at six places of each of seven parts, read as the others are."""
    return [value for part in _PARTS for value in _taped(person, part, rng)]


def _taped(person: GeneratedPerson, part: str, rng: np.random.Generator) -> Array:
    radius, aspect, power = person.sections[part]
    put = np.clip((np.arange(6) + 0.5) / 6 + rng.normal(0, 0.01, 6) / person.lengths[part], 0, 1)
    return np.asarray(np.log(section_edge(1.0, aspect, power) * radius(put)) + rng.normal(0, 0.01, 6))


def volumes(person: GeneratedPerson, rng: np.random.Generator) -> list[float]:
    """Return the logarithms of the volumes of the seven parts: what a perfect scan, cut at the true places, knows."""
    where = (np.arange(_SLICES) + 0.5) / _SLICES
    parts = [(person.lengths[part], np.mean(person.sections[part][0](where) ** 2)) for part in _PARTS]
    return [float(np.log(np.pi * length * square)) for length, square in parts]


def nothing(person: GeneratedPerson, rng: np.random.Generator) -> list[float]:
    """Return no girth."""
    return []


SEEN: dict[str, Sees] = {"no girth": nothing, "7": few, "14": usual, "42": dense, "volumes": volumes}


def seen(seeds: range, sees: Sees) -> tuple[Array, Array]:
    """Return what is seen of the people (n, k) and the logarithms of their masses by segment (n, 12)."""
    rows, masses = [], []
    for seed in seeds:
        person, rng = generate_person(seed), np.random.default_rng([seed, 3])
        lengths = np.log(np.array(list(person.lengths.values())) + rng.normal(0, 0.005, len(person.lengths)))
        body = [float(person.sex == "M"), np.log(person.stature), np.log(person.mass + rng.normal(0, 0.1))]
        rows.append([*body, *lengths, *sees(person, rng)])
        masses.append([np.log(person.masses[segment]) for segment in SEGMENTS])
    return np.array(rows), np.array(masses)


def terms(rows: Array, centre: Array, scale: Array) -> Array:
    """Return all terms of first and second degree of what is seen, in standard deviations."""
    z = (rows - centre) / scale
    i, j = np.triu_indices(z.shape[1])
    return np.column_stack([np.ones(len(z)), z, z[:, i] * z[:, j]])


def learn(rows: Array, masses: Array) -> tuple[Callable[[Array], Array], float]:
    """Return the predictor of ``masses`` (n, 12) from ``rows`` (n, k), and its ridge, the best on the last fifth."""
    centre, scale, kept = rows.mean(axis=0), rows.std(axis=0), len(rows) // 5
    every = terms(rows, centre, scale)

    def fit(x: Array, y: Array, ridge: float) -> Array:
        return np.asarray(np.linalg.solve(x.T @ x + ridge * len(x) * np.eye(x.shape[1]), x.T @ y))

    left = [np.mean((every[-kept:] @ fit(every[:-kept], masses[:-kept], r) - masses[-kept:]) ** 2) for r in _RIDGES]
    ridge = float(_RIDGES[int(np.argmin(left))])
    weights = fit(every, masses, ridge)
    return (lambda new: terms(new, centre, scale) @ weights), ridge


def main() -> None:
    """Print the table of docs/benchmarks/identification.md."""
    given = [int(word) for word in sys.argv[1:]]
    people, count, first = (*given, *(8000, 100, 501)[len(given) :])
    error, sd = compare(count, first)
    rms = [np.sqrt(np.mean(np.square(x), axis=0)) for x in (sd, error)]  # (3, 12): table, 7, 14
    left = {}
    for name, sees in SEEN.items():
        predict, ridge = learn(*seen(range(_FIRST, _FIRST + people), sees))
        rows, logs = seen(range(first, first + count), sees)
        left[name] = np.sqrt(np.mean((np.exp(predict(rows)) - np.exp(logs)) ** 2, axis=0))
        print(f"{name}: ridge {ridge:.0e}", flush=True)
    print(f"| segment | sd kg: table, 7, 14 | error kg: table, 7, 14 | learned, error kg: {', '.join(left)} |")
    print("|---|---|---|---|")
    for kind in _KINDS:
        of = np.array([kind_of(segment) == kind for segment in SEGMENTS])
        groups = [*rms, np.array(list(left.values()))]
        shown = [" ".join(f"{x:.2f}" for x in np.sqrt(np.mean(one[:, of] ** 2, axis=1))) for one in groups]
        print(f"| {kind} | {' | '.join(shown)} |")
    for word, against in zip(("sd", "error"), rms, strict=True):
        learned = [np.mean(one / against[0]) for one in left.values()]
        shown = [" ".join(f"{x:.2f}" for x in one) for one in ([np.mean(x / against[0]) for x in against], learned)]
        print(f"| all, of the table's {word} | {shown[0]} | | {shown[1]} |")


if __name__ == "__main__":
    main()
