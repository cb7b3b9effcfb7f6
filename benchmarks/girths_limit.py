"""What tapes can tell about masses at all: a predictor that learned the generator of people itself, against our solids.

    python benchmarks/girths_limit.py [people 8000] [tested 200] [first seed 501]

The predictor sees what identification sees beforehand (sex, stature, body mass, lengths wrong by 5 mm) and girths, and
learns the logarithms of the masses of thousands of generated people (`generated_people.py`) from all terms of first and
second degree, least squares with a ridge chosen on a fifth of them kept apart. It knows the laws by which these people
were drawn, which nobody knows of real people: what it leaves is what tapes cannot see (density, cuts, hands, sides), a
floor for every honest prior. It is tested on people whom it has not seen, as `bench_girths.py` draws them.
"""

import sys
from collections.abc import Callable

import numpy as np
from bench_girths import _FEW, _KINDS, priors
from generated_people import _SLICES, GeneratedPerson, generate_person, section_edge

from biodance.body.human.skeleton import SEGMENTS, kind_of
from biodance.errors import SessionRefused
from biodance.records import Array
from biodance.uncertainty.caution import widened

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


def seen(people: list[GeneratedPerson], sees: Sees) -> Array:
    """Return what is seen of the people (n, k)."""
    rows = []
    for number, person in enumerate(people):
        rng = np.random.default_rng([len(people), number])
        lengths = np.log(np.array(list(person.lengths.values())) + rng.normal(0, 0.005, len(person.lengths)))
        body = [float(person.sex == "M"), np.log(person.stature), np.log(person.mass + rng.normal(0, 0.1))]
        rows.append([*body, *lengths, *sees(person, rng)])
    return np.array(rows)


def masses_of(people: list[GeneratedPerson]) -> Array:
    """Return the true masses (n, 12) kg."""
    return np.array([[person.masses[segment] for segment in SEGMENTS] for person in people])


def terms(rows: Array, centre: Array, scale: Array) -> Array:
    """Return all terms of first and second degree of what is seen, in standard deviations."""
    z = (rows - centre) / scale
    i, j = np.triu_indices(z.shape[1])
    return np.column_stack([np.ones(len(z)), z, z[:, i] * z[:, j]])


def learn(rows: Array, masses: Array) -> Callable[[Array], Array]:
    """Return the predictor of ``masses`` (n, 12) from ``rows`` (n, k), its ridge the best on the last fifth."""
    centre, scale, kept = rows.mean(axis=0), rows.std(axis=0), len(rows) // 5
    every = terms(rows, centre, scale)

    def fit(x: Array, y: Array, ridge: float) -> Array:
        return np.asarray(np.linalg.solve(x.T @ x + ridge * len(x) * np.eye(x.shape[1]), x.T @ y))

    left = [np.mean((every[-kept:] @ fit(every[:-kept], masses[:-kept], r) - masses[-kept:]) ** 2) for r in _RIDGES]
    weights = fit(every, masses, float(_RIDGES[int(np.argmin(left))]))
    return lambda new: terms(new, centre, scale) @ weights


def judged(seeds: range) -> tuple[list[GeneratedPerson], Array, Array]:
    """Return the people whose girths are believed, and masses and their standard deviations (n, 3, 12) kg before
    anything was recorded: by the table, with seven girths, with fourteen.
    """
    people, masses, sds = [], [], []
    for seed in seeds:
        person = generate_person(seed)
        try:
            found = [widened(sip) for sip in priors(person, np.random.default_rng(seed))]
        except SessionRefused:
            continue
        people.append(person)
        masses.append([sip.mass for sip in found])
        sds.append([np.sqrt(np.diag(sip.covariance)[::10]) for sip in found])
    return people, np.array(masses), np.array(sds)


def means_known(people: list[GeneratedPerson], masses: Array) -> Array:
    """Return ``masses`` (n, 3, 12) kg times the factor for every segment and sex that makes them right in the mean of
    these people: what is left is how they differ from each other.
    """
    off, men = np.log(masses) - np.log(masses_of(people))[:, None], np.array([one.sex == "M" for one in people])
    return np.asarray(masses * np.exp(-np.where(men[:, None, None], off[men].mean(axis=0), off[~men].mean(axis=0))))


def rms(values: Array) -> Array:
    """Return the root mean square over people."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


def main() -> None:
    """Print the table of docs/benchmarks/identification.md."""
    given = [int(word) for word in sys.argv[1:]]
    count, tested, first = (*given, *(8000, 200, 501)[len(given) :])
    people, masses, sd = judged(range(first, first + tested))
    true = masses_of(people)
    groups = {"sd": rms(sd), "error": rms(masses - true[:, None])}
    groups["means known"] = rms(means_known(people, masses) - true[:, None])
    learned, left = [generate_person(seed) for seed in range(_FIRST, _FIRST + count)], []
    for sees in SEEN.values():
        predict = learn(seen(learned, sees), np.log(masses_of(learned)))
        left.append(rms(np.exp(predict(seen(people, sees))) - true))
    groups["learned"] = np.array(left)
    print(f"{len(people)} people; table, 7, 14 girths; learned: {', '.join(SEEN)}")
    print(f"| segment | {' | '.join(f'{name}, kg' for name in groups)} |\n|---|{'---|' * len(groups)}")
    for kind in _KINDS:
        of = np.array([kind_of(segment) == kind for segment in SEGMENTS])
        shown = [" ".join(f"{x:.2f}" for x in np.sqrt(np.mean(one[:, of] ** 2, axis=1))) for one in groups.values()]
        print(f"| {kind} | {' | '.join(shown)} |")
    for word in ("sd", "error"):
        shown = [" ".join(f"{np.mean(x / groups[word][0]):.2f}" for x in one) for one in groups.values()]
        print(f"| all, of the table's {word} | {' | '.join(shown)} |")


if __name__ == "__main__":
    main()
