"""What joints do that no marker shows: real sessions with and without the markers of trunk and arms, side by side.

    BIODANCE_DATA=folder python -m benchmarks unseen_joints [--only SESSION ...]

Prints the root mean square of every kind of joint (mean of a trial, rad; acceleration by band, rad/s²) in every
laboratory and in all of them, one laboratory one vote, which are the sizes ``unseen_joint`` of sizes.csv; and for each
laboratory how far the wrench without these markers differs, in units of the noise that is added for it.
"""

import argparse
import os
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.walks import CHILDREN, copied, files_of
from biodance.body.body import Body
from biodance.diagnosis.problem import TrialWindow
from biodance.identification.statistics import standing_point
from biodance.lab.session.read import read_session
from biodance.motion.dynamics import predict_wrench
from biodance.pipeline.judged_trials import chosen_windows
from biodance.pipeline.session import examine
from biodance.records import Array, Mask, Session
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.noise import Noise
from biodance.uncertainty.session_noise import of_unseen_joints

SESSIONS = (*CHILDREN, "adl_gait", "gaitalytics/test_small", "opensim_models/gait10", "opensim_models/raj_walk",
            "subject4", "laas_human/c3d")  # fmt: skip
_UPPER = ("arm", "hand", "trunk", "head", "neck", "clavicle", "shoulder")
"""What names of segments hold whose markers are taken out."""


def of_legs(session: Session, body: Body) -> Session:
    """Return a session without the markers that sit on trunk, head and arms of its ``body``."""
    segments = [*body.segments, *(part.name for part in body.parts)]
    pairs = zip(body.markers.names, body.markers.segment, strict=True)
    gone = {name for name, on in pairs if any(stem in segments[on] for stem in _UPPER)}
    shown = {trial: trial.markers.select([n for n in trial.markers.names if n not in gone])
             for trial in session.trials if trial.markers is not None}  # fmt: skip
    return replace(session, trials=tuple(replace(t, markers=shown.get(t, t.markers)) for t in session.trials))


def compared(session: Session) -> Iterator[tuple[Body, TrialWindow, Body, TrialWindow]]:
    """Yield body and trial with all markers, and the same by legs alone, of every moving trial."""
    full = examine(session)
    assert full.body is not None
    bare = examine(of_legs(session, full.body))
    assert bare.body is not None
    known = {window.trial.name: window for window in chosen_windows(full.trials)}
    for window in chosen_windows(bare.trials):
        if window.trial.role != "static" and window.trial.name in known:
            yield full.body, known[window.trial.name], bare.body, window


def squares(samples: Array, use: Mask, rate: float, *, accelerated: bool) -> Iterator[tuple[int, Array]]:
    """Yield the band and the square (n,) of every coefficient of ``samples`` (T, n): of its acceleration in all bands
    but the first, which holds the mean of a trial as one of its samples; runs of ten samples and more.
    """
    there = BANDS.at(rate)
    for pick in BANDS.runs(use, rate):
        if pick.size >= 10:
            way = 2 * np.pi * np.arange(pick.size) * there.rate / (2 * pick.size)
            found = there.coefficients(samples[pick]) * (way[:, None] ** 2 if accelerated else 1.0)
            if accelerated:
                found[0] = samples[pick].mean(axis=0)
            yield from ((int(b), found[k] ** 2) for k, b in enumerate(there.of(pick.size)) if b >= 0)


def seen(name: str) -> tuple[dict[str, Array], list[Array | str]]:
    """Return of a session the mean square (B,) of what each kind of joint does, and in the three bands of movement the
    difference (6,) of the wrench in units of the added noise.
    """
    with tempfile.TemporaryDirectory() as place:
        session = read_session(copied(files_of(Path(os.environ["BIODANCE_DATA"]), name), Path(place) / "s", ""))
    angle: dict[str, list[list[Array]]] = defaultdict(lambda: [[] for _ in range(len(BANDS))])
    wrench: list[list[Array]] = [[] for _ in range(len(BANDS))]
    noise = np.zeros((len(BANDS), 6, 6))
    for body, full, legs, bare in compared(session):
        use, rate, about = full.use & bare.use, bare.motion.rate, standing_point((bare.fit,))
        noise = of_unseen_joints(legs, bare.motion.q[len(bare.motion.q) // 2][None], about)
        for kind, apart in differences(body, full, legs, bare):
            for b, square in squares(apart[:, None], use, rate, accelerated=True):
                angle[kind][b].append(square)
        forces = predict_wrench(body, full.motion).value - predict_wrench(legs, bare.motion).value
        for b, square in squares(forces @ Noise.unit(about, BANDS).shift.T, use, rate, accelerated=False):
            wrench[b].append(square)
    width = np.array([BANDS.rate / 2, *np.diff(BANDS.edges)[1:]]) * 2 / BANDS.rate  # of a coefficient to its band
    sizes = {k: np.array([np.mean(one) if one else np.nan for one in bands]) * width for k, bands in angle.items()}
    ratio = [np.sqrt(np.mean(wrench[b], axis=0) / np.diag(noise[b])).round(2) if wrench[b] else "-" for b in (2, 3, 4)]
    return sizes, ratio


def differences(body: Body, full: TrialWindow, legs: Body, bare: TrialWindow) -> Iterator[tuple[str, Array]]:
    """Yield the kind of every joint that legs alone do not show, and by how many rad (T,) it was held elsewhere."""
    known = {joint.name: k for k, joint in enumerate(body.joints)}
    for k, joint in enumerate(legs.joints):
        if not legs.free[k] and joint.name in known:
            angles = [
                window.motion.q[:, window.motion.q.shape[1] - count + at]
                for window, count, at in ((full, len(known), known[joint.name]), (bare, len(legs.joints), k))
            ]
            kind = joint.name.removeprefix("right_").removeprefix("left_").rsplit("_", 1)[0]
            yield kind, angles[0] - angles[1]


def main() -> None:
    """Print the table of sizes and how far the wrench differs."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--only", nargs="*", default=SESSIONS)
    joints: dict[str, dict[str, list[Array]]] = defaultdict(lambda: defaultdict(list))
    for name in ask.parse_args().only:
        sizes, ratio = seen(name)
        for kind, size in sizes.items():
            joints[kind][name.split("/")[0]].append(size)
        print(name, *ratio, flush=True)
    for kind, labs in joints.items():
        each = {lab: np.nanmean(rows, axis=0) for lab, rows in labs.items()}
        every = np.array(list(each.values()))
        print(f"{kind}, all laboratories: {np.sqrt(np.nanmean(every, axis=0)).round(2)}")
        for k, lab in enumerate(each):
            print(f"    without {lab}: {np.sqrt(np.nanmean(np.delete(every, k, axis=0), axis=0)).round(2)}")
