"""Masses of people before anything was recorded: the table alone, and with girths; generated people, known truth.

    python benchmarks/bench_girths.py 100 [first seed]

The people are superelliptic stacks (`generated_people.py`), not the solids of the prior. Bone lengths are known to
5 mm, the body mass to 0.1 kg.
"""

import sys
from dataclasses import replace

import numpy as np
from generated_people import GeneratedPerson, generate_person

from biodance.body.human.prior import prior
from biodance.body.human.skeleton import SEGMENTS, Skeleton, generic_skeleton, kind_of
from biodance.body.tables.choice import reference
from biodance.errors import SessionRefused
from biodance.records import Array, Sip, Subject
from biodance.settings import Settings
from biodance.uncertainty.caution import widened

_FEW = ("thigh", "shank", "upper_arm", "forearm", "waist", "hip", "chest")
_KINDS = ("pelvis", "thigh", "shank", "foot", "trunk_head", "upper_arm", "forearm_hand")


def priors(person: GeneratedPerson, rng: np.random.Generator) -> list[Sip]:
    """Return what is known beforehand: by the table, with seven girths, with all."""
    mass = person.mass + rng.normal(0, 0.1)
    given: list[dict[str, float]] = [{}, {name: person.girths[name] for name in _FEW}, person.girths]
    found = []
    for girths in given:
        subject = Subject(mass, person.stature, person.sex, 30.0, girths=girths)
        usual = reference(Settings.table, subject)
        found.append(prior(usual, skeleton(person, generic_skeleton(usual, subject), rng), subject))
    return found


def skeleton(person: GeneratedPerson, generic: Skeleton, rng: np.random.Generator) -> Skeleton:
    """Return the generic skeleton with the person's lengths, each wrong by 5 mm."""
    own = person.lengths | {"forearm_hand": person.lengths["forearm"]}
    own |= {"pelvis": own["lower_trunk"], "trunk_head": own["lower_trunk"] + own["upper_trunk"]}
    lengths = {
        segment: own[kind_of(segment)] + rng.normal(0, 0.005) if kind_of(segment) in own else length
        for segment, length in generic.lengths.items()
    }
    return replace(generic, lengths=lengths)


def compare(count: int, first: int = 1) -> tuple[Array, Array]:
    """Return errors and standard deviations of the masses (people, 3, 12), kg: table, seven girths, all girths; as
    identification takes them (`widened`), without the people whose girths are refused.
    """
    errors, sds = [], []
    for seed in range(first, first + count):
        person = generate_person(seed)
        truth = np.array([person.masses[segment] for segment in SEGMENTS])
        try:
            found = [widened(sip) for sip in priors(person, np.random.default_rng(seed))]
        except SessionRefused as refused:
            print(f"person {seed}: {refused}", file=sys.stderr)
            continue
        errors.append([sip.mass - truth for sip in found])
        sds.append([np.sqrt(np.diag(sip.covariance)[::10]) for sip in found])
    return np.array(errors), np.array(sds)


def main() -> None:
    """Print the table of docs/benchmarks/identification.md."""
    error, sd = compare(*(int(word) for word in sys.argv[1:3]))
    inside = np.abs(error) <= 1.96 * sd
    print("| segment | sd kg: table, 7 girths, 14 | rms error kg: table, 7, 14 | % covered: table, 7, 14 |")
    print("|---|---|---|---|")
    for kind in (*_KINDS, "all (of the table's)"):
        of = np.array([kind_of(segment) == kind or kind not in _KINDS for segment in SEGMENTS])
        deviation, rms = (np.sqrt(np.mean(one[..., of] ** 2, axis=(0, 2))) for one in (sd, error))
        if kind not in _KINDS:
            deviation, rms = (
                np.mean(np.sqrt(np.mean(one**2, axis=0)) / np.sqrt(np.mean(one[:, :1] ** 2, axis=0)), axis=1)
                for one in (sd, error)
            )
        shown = [" ".join(f"{x:.2f}" for x in one) for one in (deviation, rms)]
        covered = " ".join(f"{100 * x:.0f}" for x in inside[..., of].mean(axis=(0, 2)))
        print(f"| {kind} | {shown[0]} | {shown[1]} | {covered} |")


if __name__ == "__main__":
    main()
