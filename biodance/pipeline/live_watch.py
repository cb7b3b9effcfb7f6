"""What an operator must hear of while a session is recorded: which checks look at a stream, and what is suspect now."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.watch import (
    LiveWarning,
    MarkerWatch,
    WrenchWatch,
    loaded_while_empty,
    said_of_jump,
    said_of_markers,
    silent_plates,
)
from biodance.identification.recursive import RecursivePosterior
from biodance.motion.ik.follow import Follower
from biodance.records import Array, Plate, Trial
from biodance.spatial import wrench_about_point

_EMPTY = 0.3
"""s that nobody is on a plate which is called empty: the filter forgets a foot that left in a tenth of that."""


class StreamWatch:
    """Looks at a stream as it comes. ``warnings`` all that was noticed, each once; ``suspect`` what is wrong now."""

    def __init__(self, trial: Trial, follower: Follower, *, weight: float) -> None:
        self.trial, self._follower, self._weight = trial, follower, weight
        self._markers = MarkerWatch(np.zeros(len(follower.names)))
        self._wrench = WrenchWatch(weight)
        self._sound = follower.q
        self._point: Array | None = None
        self._suspect: dict[str, LiveWarning] = {}
        self.warnings: list[LiveWarning] = []

    @property
    def suspect(self) -> tuple[str, ...]:
        """What is wrong now, in words."""
        return tuple(said.text for said in self._suspect.values())

    def look_at_markers(self, now: float, xyz: Array, distances: Array) -> None:
        """Look at the ``distances`` (n, K) m between markers and body of the last quarter of a second; ``xyz`` (K, 3) m
        the markers of the last frame.
        """
        off = self._markers.look(distances)
        if not off.any():
            self._sound = self._follower.q
            self._suspect.pop("markers", None)
            return
        if "markers" in self._suspect or np.isnan(self._sound).any():
            return
        last = np.nan_to_num(distances[-1])
        worst = [self._follower.names[i] for i in np.argsort(-last)[:5] if last[i] > 0]
        self._warn("markers", said_of_markers(now, worst, self._follower.exchange(xyz, worst, self._sound)))

    def look_at_plates(
        self,
        now: float,
        raw: Trial,
        plates: Sequence[Plate],
        on_plate: NDArray[np.bool_],
        *,
        until: int,
    ) -> None:
        """Look for a plate that fell silent, and for one that reads a load with nobody on it: channels ``raw`` and as
        filtered in ``plates``, feet ``on_plate`` (T, 2, P); frames from ``until`` on are not settled yet.
        """
        silent = {
            f"silent {said.target}": said
            for said in silent_plates(now, raw.plates, on_plate[-1].any(axis=0), self._weight)
        }
        count = max(3, round(_EMPTY * plates[0].wrench.rate))
        late = slice(max(0, until - count), until)
        gone = {said.target for said in self.warnings if said.effect == "plate_gone"}
        empty = {
            f"empty {plate.name}": said
            for index, plate in enumerate(plates)
            if until >= count
            and plate.name not in gone
            and not on_plate[late, :, index].any()
            and (said := loaded_while_empty(now, plate, plate.wrench.value[late]))
        }
        still = {f"silent {plate.name}" for plate in raw.plates if not np.diff(plate.wrench.value, axis=0).any()}
        for key in [key for key in self._suspect if key.startswith(("silent", "empty"))]:
            if key not in silent | empty and key not in still:
                del self._suspect[key]
        for key, said in (silent | empty).items():
            self._warn(key, said)

    def look_at_wrench(
        self, now: float, W: Array, wrench: Array, posterior: RecursivePosterior, *, point: Array, step: int
    ) -> None:
        """Look for a jump of the measured ``wrench`` (T, 6) against what the ``posterior`` expects from the regressor
        ``W`` (T, 6, p), ``step`` frames at once, about the first standing ``point`` (3,) m that was given.
        """
        if any(key != "wrench" for key in self._suspect):
            return
        self._point = point if self._point is None else self._point
        turned = np.swapaxes(wrench_about_point(np.swapaxes(W, 1, 2), self._point), 1, 2)
        moved, found = wrench_about_point(wrench, self._point), None
        for first in range(0, len(W), step):
            cut = slice(first, first + step)
            found = self._wrench.look(turned[cut], moved[cut], posterior)
        if found is None:
            self._suspect.pop("wrench", None)
        elif "wrench" not in self._suspect:
            self._warn("wrench", said_of_jump(now, self.trial.plates, self._point, *found))

    def noise(self, posterior: RecursivePosterior) -> Array:
        """Return the variance (6,) of the wrench about the ``posterior``, as seen so far."""
        return self._wrench.noise(posterior)

    def _warn(self, key: str, said: LiveWarning) -> None:
        known = {(w.effect, w.target) for w in self.warnings}
        self._suspect[key] = said
        if (said.effect, said.target) not in known:
            self.warnings.append(said)
