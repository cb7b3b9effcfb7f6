"""Before the recording: what a planned movement will be able to see, at which size, and which causes it will confuse.

Everything follows from the movement and the body alone: the planned trial is given the table's wrench and the model's
own markers, so that columns, tolerances and information are those of a session without fault.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.diagnosis import Unobservable
from biodance.diagnosis.naming import built
from biodance.diagnosis.observability import Visibility, detection_limits, hidden, visibility
from biodance.diagnosis.problem import Look, problem
from biodance.discovery import Chosen
from biodance.effects import Effect
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.records import Markers, Motion, Plate, Source, Trial
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances, shipped

_HALF = 0.3
"""m: half the side of the plate that is put under the movement."""
CLOSEST = 12
"""Pairs of causes that are listed."""


@dataclass(frozen=True)
class Confusion:
    """Two causes that look alike: ``cause`` at its typical size is expected to be told from ``other`` by ``difference``
    (log Bayes factor; 3 is twenty to one).
    """

    cause: tuple[str, str]
    other: tuple[str, str]
    difference: float


@dataclass(frozen=True, eq=False)
class Foresight:
    """``limits`` of all causes, easiest first; ``hidden`` those that will stay unseen; ``confusions`` the closest pairs
    among the causes that will be seen at their typical size, worst first.
    """

    limits: tuple[Unobservable, ...]
    hidden: tuple[Unobservable, ...]
    confusions: tuple[Confusion, ...]

    @property
    def separation(self) -> float:
        """The smallest difference of all pairs: a movement with a larger one tells causes apart better
        (T-optimality); 0 without a pair.
        """
        return self.confusions[0].difference if self.confusions else 0.0


@one_thread()
def foresee(
    body: Body, motions: tuple[Motion, ...], *, tolerances: Tolerances | None = None, effects: Chosen[Effect] = None
) -> Foresight:
    """Return what ``motions`` (the planned trials, in order) of ``body`` will be able to see; ``effects`` as for
    `diagnose`.

    Raises
    ------
    TrialRefused
        No motion is as long as a second.
    """
    known = tolerances or shipped()
    ends = np.cumsum([float(one.time[-1] - one.time[0]) for one in motions])
    starts = np.concatenate([[0.0], ends[:-1]])
    looks = tuple(
        Look(
            planned(body, one, f"planned_{i + 1}"), one, np.ones(one.time.size, dtype=bool), a / ends[-1], b / ends[-1]
        )
        for i, (one, a, b) in enumerate(zip(motions, starts, ends, strict=True))
    )
    put = problem(body, looks, chosen=effects)
    found, causes = built(put, known, effects)
    seen = visibility(found, causes)
    rows = tuple(sorted(detection_limits(seen, body, known.threshold), key=lambda row: row.limit / row.typical))
    return Foresight(rows, hidden(rows), _confusions(seen, rows))


def planned(body: Body, motion: Motion, name: str) -> Trial:
    """Return the trial that a laboratory without any error would record of ``motion``: one plate under its mean
    centre of pressure.
    """
    wrench = predict_wrench(body, motion)
    x, y = np.nanmean(wrench.cop()[:, :2], axis=0)
    corners = np.array(
        [
            [x + _HALF, y + _HALF, 0.0],
            [x - _HALF, y + _HALF, 0.0],
            [x - _HALF, y - _HALF, 0.0],
            [x + _HALF, y - _HALF, 0.0],
        ]
    )
    places = poses(body, motion.q).points(list(body.markers.segment), body.markers.position)
    markers = Markers(body.markers.names, motion.time, places)
    return Trial(
        name, "fit", markers, (Plate("plate1", 0, corners, wrench),), Source(Path(name), "", "planned", motion.rate)
    )


def _confusions(seen: Visibility, rows: tuple[Unobservable, ...]) -> tuple[Confusion, ...]:
    """Return the closest pairs among the causes seen at their typical size."""
    told = {(row.effect, row.target): row.limit <= row.typical for row in rows}
    found = []
    for i, one in enumerate(seen.causes):
        if not told[one.names]:
            continue
        fixed, growth = seen.separation(i)
        difference = fixed + growth * one.effect.typical[one.silent.index(False)] ** 2
        difference[i] = np.inf
        nearest = int(np.argmin(difference))
        found.append(Confusion(one.names, seen.causes[nearest].names, float(difference[nearest])))
    return tuple(sorted(found, key=lambda pair: pair.difference)[:CLOSEST])


def session_of(motion: Motion, seconds: float) -> tuple[Motion, ...]:
    """Return a long movement cut into trials of about ``seconds``."""
    count = max(1, round(float(motion.time[-1] - motion.time[0]) / seconds))
    pieces = np.array_split(np.arange(motion.time.size), count)
    return tuple(Motion(motion.time[i], motion.q[i], motion.v[i], motion.a[i]) for i in pieces)
