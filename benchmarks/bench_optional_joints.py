"""Follow real full-body walks with 23 axes and with the joints that their markers show: distances by group, forces.

    BIODANCE_DATA=folder python benchmarks/bench_optional_joints.py

RMS distance (mm) of the markers of head, trunk, arms, legs (with the pelvis) and of all; RMS difference (N) of measured
and simulated force with the masses of the table. No force is used to choose a joint.
"""

import os
from functools import partial
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.human.optional_joints import marker_groups
from biodance.lab.session.read import read_session
from biodance.pipeline.body import body_of, shown_joints
from biodance.pipeline.trial import Prepared, examine_trial, prepare_trial

SESSIONS = (*(f"biomechzoo/HC0{n}A" for n in (30, 31, 32, 38, 44, 50, 55)), "adl_gait", "pycgm")
GROUPS = ("head", "trunk", "arms", "legs")


def row(body: Body, read: Prepared, mass: float) -> list[str]:
    """Return distances (mm) of the groups and of all, and the three force differences (N)."""
    found = examine_trial(read, body, mass=mass)
    if found.fit is None:
        return ["-"] * 8
    by_group = [found.fit.by_group.get(group, np.nan) for group in GROUPS]
    force = found.comparison.rms[:3] if found.comparison else np.full(3, np.nan)
    values = [*(1000 * np.array([*by_group, found.fit.total_rms])), *force]
    return ["-" if np.isnan(value) else f"{value:.1f}" for value in values]


def main() -> None:
    """Print the tables."""
    told = []
    print("| trial | head | trunk | arms | legs | all | Fx | Fy | Fz |", "|---" * 9 + "|", sep="\n")
    for name in SESSIONS:
        session = read_session(Path(os.environ["BIODANCE_DATA"]) / name)
        read = tuple(prepare_trial(trial) for trial in sorted(session.trials, key=lambda one: one.role != "static"))
        body, _ = body_of(session.subject, read, session.settings, steps := [])
        assert body is not None
        assert set(body.markers.names) == set(dict(zip(body.markers.names, marker_groups(body), strict=True)))
        wider, shown = shown_joints(body, read, steps)
        told += [
            f"| {name} | {one.name} | {len(one.markers)} | {1000 * one.fitted:.0f} | {1000 * one.without:.0f} | "
            f"{1000 * one.with_it:.0f} | {'yes' if one.taken else 'no'} |"
            for one in shown.gains
        ]
        made = partial(row, mass=session.subject.mass)
        for one in read:
            if one.trial.role != "static":
                pairs = zip(made(body, one), made(wider, one), strict=True)
                print(f"| {one.trial.name} |", " | ".join(f"{old} -> {new}" for old, new in pairs), "|")
    print("| session | joint | markers | fitted | left out: without | with | taken |", "|---" * 7 + "|", sep="\n")
    print(*told, sep="\n")


if __name__ == "__main__":
    main()
