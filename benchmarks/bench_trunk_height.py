"""At which height of the trunk's joint are the measured forces most probable? For session folders, with their truth
or without: own, foreign, of the third laboratory, real.

    python benchmarks/bench_trunk_height.py SESSION [SESSION ...] [--lower -0.04 0.04 0.08 0.12]

The joint where movement placed it is lowered along the line to the middle of the hips, the static markers met exactly,
all trials are tracked anew, the noise is learned with each body, and the log evidence of the same frames is told less
that of the joint where it was. Positive: the forces prefer the other height.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import biodance
from biodance.body.body import Body
from biodance.body.human.scaling import Scaling, measure_static
from biodance.identification.learning import learn_noise
from biodance.identification.loads import with_unknown_load
from biodance.identification.statistics import Fit, layout_for, statistics_together, usable
from biodance.pipeline.body import calibrate_joints
from biodance.pipeline.trial import Prepared, examine_trial, prepare_trial
from biodance.records import Array, Session
from biodance.uncertainty.caution import widened

LOWER = (-0.04, 0.04, 0.08, 0.12)
"""m by which the joint is lowered."""
LEAST = 0.02
"""m over the hips below which it never goes."""


def lowered(scaling: Scaling, by: float) -> tuple[Scaling, float]:
    """Return the scaling whose trunk joint lies ``by`` m nearer to the mid hip, and its height (m) before."""
    place = dict(scaling.centres.place)
    hips = (place["right_hip"] + place["left_hip"]) / 2
    up = place["trunk"] - hips
    height = float(np.linalg.norm(up))
    place["trunk"] = hips + up * max(height - by, LEAST) / height
    return replace(scaling, centres=replace(scaling.centres, place=place)), height


def placed(session: Session) -> tuple[Scaling, tuple[Prepared, ...]]:
    """Return the person as scaled on the static trial, joints placed by movement, and the trials as prepared."""
    read = tuple(prepare_trial(one) for one in sorted(session.trials, key=lambda trial: trial.role != "static"))
    static = next(one.trial for one in read if one.trial.role == "static" and one.usable)
    return calibrate_joints(measure_static(session.subject, static), read), read


def tracked(body: Body, read: Sequence[Prepared], mass: float) -> dict[str, Fit]:
    """Return the trials with role fit as the body follows them, by name."""
    done = [examine_trial(one, body, mass=mass) for one in read if one.trial.role == "fit"]
    return {
        one.name: Fit(one.name, one.motion, one.trial.wrench, one.comparison.used)
        for one in done
        if one.motion is not None and one.comparison is not None and one.trial.wrench is not None
    }


def log_evidence(body: Body, fits: Sequence[Fit], about: Array) -> float:
    """Return the logarithm of the evidence of the trials, each band under the noise learned with this body."""
    total = statistics_together(body, fits, layout_for(about))
    noise, posterior = learn_noise(total, with_unknown_load(body, widened(body.sip, body.joint_errors)))
    return posterior.log_evidence - 0.5 * float(total.count @ np.linalg.slogdet(noise.covariance)[1])


def preferred(session: Session, lower: Sequence[float]) -> tuple[float, list[float]]:
    """Return the height (m) of the joint over the hips, and the log evidence of each lowering less that of none."""
    scaling, read = placed(session)
    height = lowered(scaling, 0.0)[1]
    bodies = [lowered(scaling, by)[0].body()[0] for by in (0.0, *lower)]
    trials = [tracked(body, read, session.subject.mass) for body in bodies]
    believed, about, _ = usable(bodies[0], tuple(trials[0].values()))
    names = [fit.name for fit in believed if all(fit.name in some for some in trials)]
    use = {name: np.all([some[name].use for some in trials], axis=0) for name in names}
    value = [
        log_evidence(body, [replace(some[name], use=use[name]) for name in names], about)
        for body, some in zip(bodies, trials, strict=True)
    ]
    return height, [one - value[0] for one in value[1:]]


def main() -> None:
    """Print one line of Markdown per session."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("sessions", type=Path, nargs="+")
    ask.add_argument("--lower", type=float, nargs="+", default=list(LOWER))
    asked = ask.parse_args()
    print(f"| session | joint over hips, mm | {' | '.join(f'lower by {1e3 * by:.0f} mm' for by in asked.lower)} |")
    print("|" + "---|" * (2 + len(asked.lower)))
    for folder in asked.sessions:
        height, gains = preferred(biodance.read_session(folder), asked.lower)
        print(f"| {folder.name} | {1e3 * height:.0f} | {' | '.join(f'{gain:+.1f}' for gain in gains)} |", flush=True)


if __name__ == "__main__":
    main()
