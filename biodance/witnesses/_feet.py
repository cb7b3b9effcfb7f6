"""Where the feet and the pelvis were, by their markers."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.motion.contact.soles import OUTLINE
from biodance.records import SIDES, Array, Markers
from biodance.records.arrays import rate_of

_UNSEEN = 0.05
"""s over which a marker that was not seen is believed to go on straight."""
_KEPT = 64
"""Sets of times at which a foot's place is kept."""
_HALF_BREADTH = 0.28
"""Half the distance of the outer markers of the forefoot, in units of that from the heel to the outermost one: 0.26 to
0.29 in nine persons with shoes of two laboratories, 0.23 and 0.35 in two others: 8 mm either way.
"""


@dataclass(frozen=True, eq=False)
class FootPath:
    """One foot: ``time`` (T,) s; ``heel``, ``toe`` (T, 3) m of its markers, lab frame, NaN = not seen; ``front`` (T, 3)
    m, middle of the forefoot where markers on its edges tell it, else the toe marker (``by_edges`` False: where on the
    forefoot it sits is not known); ``centred`` False: its only toe marker is on one edge.
    """

    side: str
    time: Array
    heel: Array
    toe: Array
    front: Array
    by_edges: bool = False
    centred: bool = True
    _known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict, init=False, repr=False)
    _ways: dict[bytes, tuple[Array, Array, Array, Array]] = field(default_factory=dict, init=False, repr=False)
    _drifts: dict[bytes, Array] = field(default_factory=dict, init=False, repr=False)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return heel and front (n, 3) m at other times (n,) s; NaN beside frames in which they were not seen.

        It is kept: witnesses are asked for the same times again and again, of recordings whose plates were altered.
        """
        key = time.tobytes()
        if key not in self._known:
            if len(self._known) >= _KEPT:
                self._known.pop(next(iter(self._known)))
            self._known[key] = path_at(self.time, self.heel, time), path_at(self.time, self.front, time)
        return self._known[key]

    def outline(self, time: Array) -> Array:
        """Return the sole (n, P, 2) m seen from above, from the heel marker and the front."""
        heel, front = (path[:, :2] for path in self.at(time))
        ahead = front - heel
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        return heel[:, None] + OUTLINE[:, :1] * ahead[:, None] + OUTLINE[:, 1:] * left[:, None]

    def axes(self, time: float) -> Array:
        """Return the horizontal unit vectors (2, 2) from the heel marker to the front and outwards, at ``time`` s."""
        heel, front = (path[0, :2] for path in self.at(np.array([time])))
        ahead = (front - heel) / np.linalg.norm(front - heel)
        return np.stack([ahead, np.array([ahead[1], -ahead[0]]) * (1.0 if self.side == "right" else -1.0)])

    def in_foot(self, time: Array, point: Array) -> tuple[Array, Array, Array]:
        """Return how far ``point`` (n, 2) m lies ahead of the heel marker and outwards of the line to the front, m
        (n,), and the horizontal distance of the two (n,) m.
        """
        heel, ahead, out, length = self._lines(time)
        x, y = (point - heel).T
        return x * ahead[:, 0] + y * ahead[:, 1], x * out[:, 0] + y * out[:, 1], length

    def _lines(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Return the heel (n, 2) m, the directions ahead and outwards (n, 2) and the length (n,) m of the foot; kept,
        like the places.
        """
        key = time.tobytes()
        if key not in self._ways:
            if len(self._ways) >= _KEPT:
                self._ways.pop(next(iter(self._ways)))
            heel, front = (path[:, :2] for path in self.at(time))
            length = np.linalg.norm(front - heel, axis=1)
            ahead = (front - heel) / length[:, None]
            out = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1) * (1.0 if self.side == "right" else -1.0)
            self._ways[key] = heel, ahead, out, length
        return self._ways[key]

    @property
    def rate(self) -> float:
        """Hz of the markers."""
        return rate_of(self.time)

    @cached_property
    def velocity(self) -> Array:
        """(T, 3) m/s of the middle between the two markers."""
        if self.time.size < 2:
            return np.zeros((self.time.size, 3))
        return np.gradient((self.heel + self.toe) / 2, self.time, axis=0)

    @cached_property
    def pointing(self) -> Array:
        """(3,) m from the heel marker to the front, the median over the trial."""
        return np.asarray(np.nanmedian(self.front - self.heel, axis=0))

    def drift(self, time: Array) -> Array:
        """Return the median velocity (3,) m/s at some times: that of the belt a foot stands on, or nearly none. It is
        kept, like the places.
        """
        key = time.tobytes()
        if key not in self._drifts:
            if len(self._drifts) >= _KEPT:
                self._drifts.pop(next(iter(self._drifts)))
            velocity = path_at(self.time, self.velocity, time)
            known = velocity[np.isfinite(velocity).all(axis=1)]
            self._drifts[key] = np.median(known, axis=0) if len(known) else np.full(3, np.nan)
        return self._drifts[key]


def path_at(known: Array, path: Array, time: Array) -> Array:
    """Return a path (T, n) at other times, straight between frames; NaN where no frame near is known."""
    seen = np.isfinite(path).all(axis=1)
    if not seen.any():
        return np.full((len(time), path.shape[1]), np.nan)
    at, values = known[seen], path[seen]
    out = np.stack([np.interp(time, at, column) for column in values.T], axis=1)
    after = np.clip(np.searchsorted(at, time), 0, at.size - 1)
    near = np.minimum(np.abs(time - at[after]), np.abs(time - at[np.maximum(after - 1, 0)]))
    out[near > _UNSEEN] = np.nan
    return out


def feet_of(markers: Markers | None, known: tuple[str, ...]) -> tuple[FootPath, ...]:
    """Return both feet by the landmarks heel and toe of the first of the ``known`` marker sets that has all four; ()
    without.
    """
    if markers is None or not markers.time.size:
        return ()
    for name in known:
        found = {(s, p): _landmark(markers, name, f"{s}_{p}") for s in SIDES for p in ("heel", "toe")}
        places = {key: path for key, path in found.items() if path is not None and np.isfinite(path).any()}
        if len(places) == len(found):
            return tuple(_foot(markers, name, side, places[side, "heel"], places[side, "toe"]) for side in SIDES)
    return ()


def _foot(markers: Markers, set_name: str, side: str, heel: Array, toe: Array) -> FootPath:
    """Return one foot with its front: the middle of the markers on both edges of the forefoot, or half a forefoot's
    breadth inside that on the outer one, if it lies outwards of the toe marker (its label may be another's).
    """
    inner, outer = (_landmark(markers, set_name, f"{side}_toe_{edge}") for edge in ("medial", "lateral"))
    if any(edge is not None and np.array_equal(toe, edge, equal_nan=True) for edge in (inner, outer)):
        return FootPath(side, markers.time, heel, toe, toe, centred=False)
    if inner is not None and outer is not None:
        return FootPath(side, markers.time, heel, toe, (inner + outer) / 2, by_edges=True)
    found = FootPath(side, markers.time, heel, toe, toe)
    if outer is None or not np.nanmedian(found.in_foot(markers.time, outer[:, :2])[1]) > 0:
        return found
    along = (outer - heel)[:, :2]
    front = np.array(outer)
    front[:, :2] += _HALF_BREADTH * (1 if side == "right" else -1) * np.stack([-along[:, 1], along[:, 0]], axis=1)
    return FootPath(side, markers.time, heel, toe, front, by_edges=True)


def _landmark(markers: Markers, set_name: str, name: str) -> Array | None:
    try:
        return landmark(markers, read_marker_set(set_name), name)
    except BiodanceError:
        return None


def pelvis_path(markers: Markers | None, known: tuple[str, ...]) -> Array | None:
    """Return the middle (T, 3) m of the front and back of the pelvis; None where no ``known`` set has them."""
    for name in known if markers is not None else ():
        assert markers is not None
        right, left, back = (_landmark(markers, name, place) for place in ("right_asis", "left_asis", "mid_psis"))
        if right is not None and left is not None and back is not None:
            middle = ((right + left) / 2 + back) / 2
            return middle if np.isfinite(middle).any() else None
    return None
