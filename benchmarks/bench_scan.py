"""Masses and CoM of people before anything was recorded: the table alone, with the outlines of the feet, with a scan,
with a scan and girths; scanned people with known truth.

    python benchmarks/bench_scan.py 60 [first seed]

The people are superelliptic tubes (`scanned_people.py`). Bone lengths, ankles and shoulders are known to 5 mm, the body
mass to 0.1 kg, feet to 3 mm.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from bench_girths import _KINDS, skeleton
from bench_people import deviations
from scanned_people import HIP, ScannedPerson, scanned_person

from biodance.body.human.prior import prior
from biodance.body.human.skeleton import SEGMENTS, Skeleton, generic_skeleton, kind_of
from biodance.body.tables.choice import reference
from biodance.errors import SessionRefused
from biodance.records import SIDES, Array, FootSizes, Sip, Subject
from biodance.settings import Settings
from biodance.uncertainty.caution import widened

WAYS = ("table", "foot outlines", "scan", "scan and girths")


def measured_skeleton(scanned: ScannedPerson, subject: Subject, rng: np.random.Generator) -> Skeleton:
    """Return the generic skeleton with the person's own lengths and widths, each wrong by 5 mm."""
    found = skeleton(scanned.person, generic_skeleton(reference(Settings.table, subject), subject), rng)
    origins = {name: np.array(place) for name, place in found.origins.items()}
    origins["trunk"] = np.array([0.0, found.lengths["pelvis"], 0.0])
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        origins[f"{side}_shoulder"][2] = sign * (scanned.shoulder + rng.normal(0, 0.005))
        origins[f"{side}_hip"][2] = sign * (HIP * scanned.person.stature + rng.normal(0, 0.005))
    ankle = {side: scanned.ankle + rng.normal(0, 0.005) for side in SIDES}
    return replace(found, origins=origins, ankle_height=ankle)


def priors(scanned: ScannedPerson, rng: np.random.Generator, folder: Path) -> list[Sip]:
    """Return what is known beforehand, in the `WAYS`, as identification takes it."""
    person, path = scanned.person, folder / f"{rng.integers(1 << 40)}.ply"
    scanned.mesh.export(path)
    plain = Subject(person.mass + rng.normal(0, 0.1), person.stature, person.sex, 30.0)
    outline = {side: FootSizes(*(np.array(scanned.feet) + rng.normal(0, 0.003, 3))) for side in SIDES}
    whole = replace(plain, scan=str(path))
    given = (plain, replace(plain, foot_outline=outline), whole, replace(whole, girths=person.girths))
    bones = measured_skeleton(scanned, plain, rng)
    return [widened(prior(reference(Settings.table, plain), bones, subject)) for subject in given]


def compare(count: int, first: int = 1) -> tuple[Array, Array]:
    """Return errors and standard deviations (people, 4 ways, 12, 4) of mass kg and CoM m."""
    errors, sds = [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            scanned = scanned_person(seed)
            mass = np.array([scanned.person.masses[name] for name in SEGMENTS])
            com = np.array([scanned.com[name] for name in SEGMENTS])
            try:
                found = priors(scanned, np.random.default_rng(seed), Path(folder))
            except SessionRefused as refused:
                print(f"person {seed}: {refused}", file=sys.stderr)
                continue
            errors.append([np.column_stack([sip.mass - mass, sip.com - com]) for sip in found])
            sds.append([deviations(sip) for sip in found])
    return np.array(errors), np.array(sds)


def rms(values: Array) -> Array:
    """Return the root mean square over people and the last axes, one number a way."""
    return np.sqrt(np.mean(np.square(values), axis=(0, *range(2, values.ndim))))


def main() -> None:
    """Print the table of docs/benchmarks/identification.md."""
    error, sd = compare(*(int(word) for word in sys.argv[1:3]))
    inside = np.abs(error) <= 1.96 * sd
    print(f"{len(error)} people; {', '.join(WAYS)}")
    print("| segment | sd kg | rms error kg | % covered | CoM along, sd mm | rms error mm |\n|---|---|---|---|---|---|")
    for kind in _KINDS:
        of = np.array([kind_of(segment) == kind for segment in SEGMENTS])
        along = 1 if kind == "foot" else 2
        words = [rms(sd[:, :, of, 0]), rms(error[:, :, of, 0]), 100 * inside[:, :, of, 0].mean(axis=(0, 2))]
        words += [1000 * rms(one[:, :, of, along]) for one in (sd, error)]
        shown = [" ".join(f"{x:.{d}f}" for x in word) for word, d in zip(words, (2, 2, 0, 0, 0), strict=True)]
        print(f"| {kind} | {' | '.join(shown)} |")
    share = [
        np.mean(np.sqrt(np.mean(one[..., 0] ** 2, axis=0)) / np.sqrt(np.mean(one[:, :1, :, 0] ** 2, axis=0)), axis=1)
        for one in (sd, error)
    ]
    words = [" ".join(f"{x:.2f}" for x in one) for one in share]
    words += [" ".join(f"{100 * x:.0f}" for x in inside[..., 0].mean(axis=(0, 2)))]
    print(f"| all (of the table's) | {' | '.join(words)} | | |")
    print(
        f"all masses: {rms(error[..., 0]).round(3)} kg; all CoM: {1000 * rms(np.linalg.norm(error[..., 1:], axis=-1))}"
    )


if __name__ == "__main__":
    main()
