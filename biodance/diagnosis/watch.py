"""Checks that run while a session is recorded: a marker suddenly off the body, a wrench that jumps away from what the
body needs, a plate that falls silent, an empty plate that reads a load.

Each looks for a CHANGE within the recording, so that a body that the table describes badly raises no alarm; what was
wrong from the start is the business of `diagnose`.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from biodance.effects.labels_swapped import LabelsSwapped
from biodance.effects.marker_misplaced import MarkerMisplaced
from biodance.effects.plate_offset import PlateOffset
from biodance.identification.knowledge import RecursivePosterior
from biodance.records import CHANNELS, Array, Plate
from biodance.spatial import wrench_about_point

_FAST, _REFERENCE, _LEAST = 10, 100, 20
"""Tenths of a second: mean that is judged, the most and the fewest before it that it is held against."""
_HALF = 5
"""Tenths of a second."""
SIGMAS_OF_A_JUMP = 6.0
"""Standard deviations: with a test every 0.1 s on six channels a false alarm must be rarer than one an hour."""
_SMALLEST_JUMP = 0.01
"""Share of body weight (and of body weight times 1 m): jumps this small are not worth an interruption."""
MARKER_OFF = 0.05
"""m: least distance between marker and body that is a fault; soft tissue moves a skin marker by up to 40 mm (thigh)."""
_TIMES, _SWAPPED = 2.5, 0.3
"""A marker is off at so many times its usual distance; an exchange explains it that leaves at most this share."""
EMPTY_LOAD = 15.0
"""N that an empty plate may read."""
_SILENT, _GONE = 0.2, 0.2
"""s without any change of a raw channel: no amplifier is so quiet; share of body weight that a plate carried just
before, to count as gone.
"""


@dataclass(frozen=True)
class LiveWarning:
    """What was noticed at ``time_s``: an ``effect`` (of the family of causes, or plate_gone) on a ``target``, in words
    with what to do.
    """

    time_s: float
    effect: str
    target: str
    text: str


@dataclass
class MarkerWatch:
    """Distances of markers: ``usual`` (K,) m² running mean square of each while nothing is wrong, over
    ``count`` looks.
    """

    usual: Array
    count: int = 0

    def look(self, distances: Array) -> NDArray[np.bool_]:
        """Return (K,) True for markers that are off, from the last ``distances`` (n, K) m, a quarter of a second."""
        seen = np.isfinite(distances)
        now = np.where(seen.any(axis=0), np.nanmedian(np.where(seen.any(axis=0), distances, 0.0), axis=0), 0.0)
        limit = np.maximum(MARKER_OFF, _TIMES * np.sqrt(self.usual)) if self.count >= _FAST else np.inf
        off = now > limit
        if not off.any():
            self.count += 1
            # Running mean: a look counts 1 / count, later 1 / `_REFERENCE`.
            self.usual = self.usual + (now**2 - self.usual) / min(self.count, _REFERENCE)
        return np.asarray(off)


def said_of_markers(time: float, worst: Sequence[str], pair: tuple[str, str, float] | None) -> LiveWarning:
    """Return the warning about the markers that are off, the ``worst`` first; ``pair`` the best exchange and what it
    leaves.
    """
    if pair and pair[2] < _SWAPPED:
        one, other = sorted(pair[:2])
        text = f"{one} and {other} carry each other's label: look at the labelling of the live model."
        return LiveWarning(time, LabelsSwapped.name, f"{one}/{other}", text)
    text = f"{worst[0]} is away from where the body has it: is it still on the skin, and rightly labelled?"
    return LiveWarning(time, MarkerMisplaced.name, worst[0], text)


@dataclass
class WrenchWatch:
    """Means over a tenth of a second of regressor (6, p) and measured wrench (6,): those ``before``, from while nothing
    was wrong, and those of the last second, ``now``.

    ``weight`` N of the body.
    """

    weight: float
    before: deque[tuple[Array, Array]] = field(default_factory=lambda: deque(maxlen=_REFERENCE))
    now: deque[tuple[Array, Array]] = field(default_factory=deque)
    wrong: bool = False

    def look(self, W: Array, wrench: Array, posterior: RecursivePosterior) -> tuple[Array, Array] | None:
        """Return the jump (6,) N, N·m of the last second against the time before, and its size in standard deviations
        (6,); None where there is none or too little to tell.

        ``W`` (n, 6, p) and ``wrench`` (n, 6) of a tenth of a second, about a point that stays. What is not known of the
        body counts as far as the body stood otherwise before.
        """
        self.now.append((W.mean(axis=0), wrench.mean(axis=0)))
        if len(self.now) > _FAST:
            oldest = self.now.popleft()
            if not self.wrong:
                self.before.append(oldest)
        if len(self.before) < _LEAST:
            return None
        W0, then = (np.array(part) for part in zip(*self.before, strict=True))
        W1, late = (np.array(part) for part in zip(*self.now, strict=True))
        usual, latest = then - W0 @ posterior.mean, late - W1 @ posterior.mean
        jump = latest.mean(axis=0) - usual.mean(axis=0)
        # Uncertain parameters count through the difference of the regressors: what both share cancels.
        _, unknown = posterior.expected(W1.mean(axis=0) - W0.mean(axis=0))
        # Of means over half a second: what moves faster hardly shows in the mean of a second.
        blocks = len(usual) // _HALF
        slow = usual[-blocks * _HALF :].reshape(blocks, _HALF, -1).mean(axis=1).var(axis=0)
        # At `SIGMAS_OF_A_JUMP` deviations a jump is at least `_SMALLEST_JUMP` of the weight.
        sd = np.sqrt(slow + unknown + (_SMALLEST_JUMP * self.weight / SIGMAS_OF_A_JUMP) ** 2)
        size = np.abs(jump) / sd
        self.wrong = bool((size > SIGMAS_OF_A_JUMP).any())
        return (jump, size) if self.wrong else None

    def noise(self, posterior: RecursivePosterior) -> Array:
        """Return (6,) the variance of what the body leaves of late; generous before there is enough."""
        if len(self.before) < _LEAST:
            return np.full(6, (0.03 * self.weight) ** 2)
        W, wrench = (np.array(part) for part in zip(*self.before, strict=True))
        # What the body leaves, and what no body may leave less of.
        return np.asarray((wrench - W @ posterior.mean).var(axis=0)) + (_SMALLEST_JUMP * self.weight / 2) ** 2


def said_of_jump(time: float, plates: Sequence[Plate], about: Array, jump: Array, size: Array) -> LiveWarning:
    """Return the warning about a jump (6,) about the point ``about`` (3,) m: its strongest channel, and the plate
    about whose centre it has the smallest moment.
    """
    moments = [
        float(np.linalg.norm(wrench_about_point(jump[None], np.asarray(plate.centre) - about)[0, 3:]))
        for plate in plates
    ]
    plate = plates[int(np.argmin(moments))]
    forces = size[:3] > SIGMAS_OF_A_JUMP
    channel = int(np.argmax(np.where(forces, size[:3], 0.0))) if forces.any() else 3 + int(np.argmax(size[3:]))
    unit = "N" if channel < 3 else "N·m"
    text = (
        f"{plate.name}: {CHANNELS[channel]} jumped by {jump[channel]:+.0f} {unit} and stays. Did the person pick "
        f"something up, or touch something? If not, zero the plate while nobody stands on it."
    )
    return LiveWarning(time, PlateOffset.name, f"{plate.name}:{CHANNELS[channel]}", text)


def silent_plates(time: float, plates: Sequence[Plate], under: Array, weight: float) -> tuple[LiveWarning, ...]:
    """Return a warning for every plate of a window with a foot over it (``under`` (P,) bool) whose raw channels are
    unknown, stand still beside zero, or became zero all at once while it carried a share of the ``weight`` N.

    A load that faded to nothing is a foot that left: some systems write exact zeros then.
    """
    found = []
    for plate, foot in zip(plates, under, strict=True):
        value = plate.wrench.value
        late = value[-max(3, round(_SILENT * plate.wrench.rate)) :]
        changed = np.flatnonzero((np.diff(value, axis=0) != 0).any(axis=1))
        torn = changed.size and abs(value[changed[-1], 2]) > _GONE * weight
        still = bool((late == late[0]).all()) and (torn or late[0].any())
        if foot and (still or bool(np.isnan(late).any())):
            text = f"{plate.name} says nothing any more while a foot is on it: check its cable and amplifier."
            found.append(LiveWarning(time, "plate_gone", plate.name, text))
    return tuple(found)


def loaded_while_empty(time: float, plate: Plate, value: Array) -> LiveWarning | None:
    """Return a warning where an empty plate reads a force: ``value`` (n, 6) N, N·m, its filtered wrench meanwhile."""
    mean = value[:, :3].mean(axis=0)
    channel = int(np.argmax(np.abs(mean)))
    if not np.abs(mean[channel]) > EMPTY_LOAD:
        return None
    text = f"{plate.name} reads {mean[channel]:+.0f} N in {CHANNELS[channel]} while nobody is on it: zero it."
    return LiveWarning(time, PlateOffset.name, f"{plate.name}:{CHANNELS[channel]}", text)
