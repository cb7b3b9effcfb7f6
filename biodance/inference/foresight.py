"""Before the recording: what a planned movement will be able to see, at which size, and which causes it will confuse.

Everything follows from the movement and the body alone: the planned trial is given the table's wrench and the model's
own markers, so that columns, tolerances and information are those of a session without fault.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.candidates import Candidate
from biodance.diagnosis.consequence import Unobservable
from biodance.diagnosis.model import causes_of
from biodance.diagnosis.problem import TrialWindow, problem
from biodance.discovery import Chosen
from biodance.effects import Effect
from biodance.effects import effects as known_effects
from biodance.inference.observability import Visibility, detection_limits, hidden, visibility
from biodance.inference.rows import rows_of
from biodance.inference.scales import nominal
from biodance.inference.sets import Search
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Markers, Motion, Plate, Source, Trial
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances, shipped

_HALF = 0.3
"""m: half the side of the plate that is put under the movement."""
CLOSEST = 12
"""Pairs of causes that are listed."""
TOLD = 3.0
"""Log Bayes factor from which two causes count as told apart: twenty to one."""


@dataclass(frozen=True)
class Confusion:
    """Two causes that look alike: ``cause`` at its typical size is expected to be told from ``other`` by ``difference``
    (log Bayes factor; 3 is twenty to one).
    """

    cause: tuple[str, str]
    other: tuple[str, str]
    difference: float


@dataclass(frozen=True)
class Remedy:
    """What to ``do`` beside the movement, so that causes are seen that it hides (``unseen``) and told apart that it
    confuses (``confused``): effect and target of each.
    """

    do: str
    unseen: tuple[tuple[str, str], ...]
    confused: tuple[tuple[str, str], ...]


@dataclass(frozen=True, eq=False)
class Foresight:
    """``limits`` of all causes, easiest first; ``hidden`` those that will stay unseen; ``confusions`` the closest pairs
    among the causes that will be seen at their typical size, worst first; ``changes`` what would help, that which helps
    against most causes first.
    """

    limits: tuple[Unobservable, ...]
    hidden: tuple[Unobservable, ...]
    confusions: tuple[Confusion, ...]
    changes: tuple[Remedy, ...] = ()

    @property
    def seen(self) -> tuple[Unobservable, ...]:
        """The causes that will be seen at their typical size."""
        return tuple(row for row in self.limits if row.limit <= row.typical)

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
    windows = tuple(
        TrialWindow(
            planned(body, one, f"planned_{i + 1}"), one, np.ones(one.time.size, dtype=bool), a / ends[-1], b / ends[-1]
        )
        for i, (one, a, b) in enumerate(zip(motions, starts, ends, strict=True))
    )
    put = problem(body, windows, chosen=effects)
    every, family = causes_of(put, known, effects), known_effects(effects)
    rows = rows_of(put, every, known, None)
    search = Search.of(rows, tuple(one for one in every if one.names[0] in family))
    seen = visibility(search, nominal(rows))
    limits = tuple(sorted(detection_limits(seen, body), key=lambda row: row.limit / row.typical))
    return Foresight(limits, hidden(limits), pairs := _confusions(seen, limits), _changes(seen.causes, limits, pairs))


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
        # Expected at the typical size a: fixed + growth a².
        difference = fixed + growth * one.effect.typical[one.silent.index(False)] ** 2
        difference[i] = np.inf
        nearest = int(np.argmin(difference))
        found.append(Confusion(one.names, seen.causes[nearest].names, float(difference[nearest])))
    return tuple(sorted(found, key=lambda pair: pair.difference)[:CLOSEST])


def _changes(
    causes: tuple[Candidate, ...], rows: tuple[Unobservable, ...], pairs: tuple[Confusion, ...]
) -> tuple[Remedy, ...]:
    """Return what to do, in the words of the effects that stay unseen at their typical size or are confused."""
    words = {one.effect.name: one.effect.separated_by for one in causes}
    unseen = [(row.effect, row.target) for row in rows if row.limit > row.typical]
    confused = [pair.cause for pair in pairs if pair.difference < TOLD]
    out: dict[str, tuple[list[tuple[str, str]], list[tuple[str, str]]]] = {}
    for k, some in enumerate((unseen, confused)):
        for cause in some:
            if words.get(cause[0]):
                out.setdefault(words[cause[0]], ([], []))[k].append(cause)
    found = [Remedy(do, tuple(hides), tuple(mixed)) for do, (hides, mixed) in out.items()]
    return tuple(sorted(found, key=lambda one: -len(one.unseen) - len(one.confused)))


def session_of(motion: Motion, seconds: float) -> tuple[Motion, ...]:
    """Return a long movement cut into trials of about ``seconds``."""
    count = max(1, round(float(motion.time[-1] - motion.time[0]) / seconds))
    pieces = np.array_split(np.arange(motion.time.size), count)
    return tuple(map(motion.at, pieces))
