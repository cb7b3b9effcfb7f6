"""Small cases on which every effect is tried, and what the docstring of an effect must say."""

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from human_cases import human_case
from random_bodies import random_body
from scipy.interpolate import CubicSpline

from biodance.effects import Case, QualityCheck, Recorded
from biodance.motion.dynamics import predict_wrench
from biodance.records import Motion, Plate, Session, Source, Subject, Trial, Wrench


@cache
def example(plates: int = 1) -> Case:
    """Return a smooth trial of a random tree on one or two plates."""
    rng = np.random.default_rng(0)
    body = random_body(rng, n_segments=4)
    time = np.arange(120) / 100
    curve = CubicSpline(np.arange(0, 2.5, 0.5), rng.normal(0, 0.5, (5, len(body.joints))))
    q = np.tile(body.neutral, (120, 1))
    q[:, :3] += [0.4, 0.2, 1.0]
    v, a = np.zeros((120, body.nv)), np.zeros((120, body.nv))
    q[:, 7:], v[:, 6:], a[:, 6:] = curve(time), curve(time, 1), curve(time, 2)
    motion = Motion(time, q, v, a)
    value = predict_wrench(body, motion).value + rng.normal(0, 1.0, (120, 6))
    corners = np.array([[0.6, 0.5, 0], [0.2, 0.5, 0], [0.2, -0.1, 0], [0.6, -0.1, 0]])
    share = [1.0] if plates == 1 else [0.7, 0.3]
    made = tuple(
        Plate(f"plate{i + 1}", 2, corners + np.array([0.5 * i, 0, 0]), Wrench(time, s * value))
        for i, s in enumerate(share)
    )
    trial = Trial("t", "fit", None, made, Source(__file__, "", "test"))
    return Case(body, trial, motion, body.sip.phi, time / time[-1])


def failed(found: tuple[QualityCheck, ...]) -> list[tuple[str, str]]:
    """Return effect and target of the checks that failed."""
    return [(quality.effect, quality.target) for quality in found if not quality.ok]


def session_of(*cases: Case) -> Recorded:
    """Return a session of a man of 70 kg with the trials of some cases."""
    trials = tuple(case.trial for case in cases)
    return Recorded(Session(Subject(70.0, 1.75, "M"), trials, Path()), cases)


class Cases(Mapping[int | str, Case]):
    """The cases by number of plates, and the human's: each is made when it is asked for, as that one is tracked."""

    def __getitem__(self, which: int | str) -> Case:
        return human_case(120) if which == "human" else example(int(which))

    def __iter__(self) -> Iterator[int | str]:
        return iter((1, 2, "human"))

    def __len__(self) -> int:
        return 3


CASES = Cases()
