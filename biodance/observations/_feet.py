"""Where the feet and the pelvis were, by their markers."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.motion.soles import OUTLINE
from biodance.records import SIDES, Array, Markers, Wrench
from biodance.records.arrays import rate_of

_UNSEEN = 0.05
"""s over which a marker that was not seen is believed to go on straight."""
_HALF_BREADTH = 0.28
"""Half the distance of the outer markers of the forefoot, in units of that from the heel to the outermost one: 0.26 to
0.29 in nine persons with shoes of two laboratories, 0.23 and 0.35 in two others: 8 mm either way.
"""


@dataclass(frozen=True, eq=False)
class Track:
    """A path where it was seen: ``time`` (T,) s and ``place`` (n, T) m."""

    time: Array
    place: Array

    @cached_property
    def speed(self) -> Array:
        """(n, T) m/s."""
        # Second order in the middle, one-sided at the ends; differences go over gaps, too.
        return np.asarray(np.gradient(self.place, self.time, axis=1)) if self.time.size > 1 else 0.0 * self.place

    def at(self, time: Array) -> Array:
        """Return places (t, n) m at other times, straight between frames; NaN where no frame near is known."""
        return self._between(self.place, time)

    def speed_at(self, time: Array) -> Array:
        """Return velocities (t, n) m/s at other times."""
        return self._between(self.speed, time)

    def _between(self, values: Array, time: Array) -> Array:
        if not self.time.size:
            return np.full((time.size, len(values)), np.nan)
        out = np.stack([np.interp(time, self.time, one) for one in values], axis=1)
        after = np.minimum(np.searchsorted(self.time, time), self.time.size - 1)
        # Distance in time to the nearer one of the two neighbouring frames.
        near = np.minimum(np.abs(time - self.time[after]), np.abs(time - self.time[np.maximum(after - 1, 0)]))
        out[near > _UNSEEN] = np.nan
        return out


def track_of(time: Array, path: Array) -> Track:
    """Return the track of a path (T, n) m, NaN where it was not seen."""
    seen = np.isfinite(path).all(axis=1)
    return Track(time[seen], np.ascontiguousarray(path[seen].T))


@dataclass(frozen=True, eq=False)
class InFoot:
    """Points in the frame of a foot, or what moves it: ``axes`` (n, 2, 2) unit vectors from the heel marker to the
    front, and outwards; ``place`` (n, 2) m of the points along them from the heel marker; ``moves`` (n, 2) m/s: how
    fast fixed points go along them because the foot moves; ``length`` (n,) m from the heel marker to the front.
    """

    axes: Array
    place: Array
    moves: Array
    length: Array


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

    @cached_property
    def tracks(self) -> tuple[Track, Track]:
        """Heel marker and front where they were seen."""
        return track_of(self.time, self.heel), track_of(self.time, self.front)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return heel and front (n, 3) m at other times (n,) s; NaN beside frames in which they were not seen."""
        heel, front = self.tracks
        return heel.at(time), front.at(time)

    def outline(self, time: Array) -> Array:
        """Return the sole (n, P, 2) m seen from above, from the heel marker and the front."""
        heel, front = (path[:, :2] for path in self.at(time))
        ahead = front - heel
        # Up x ahead: to the left.
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        return heel[:, None] + OUTLINE[:, :1] * ahead[:, None] + OUTLINE[:, 1:] * left[:, None]

    def axes(self, time: float) -> Array:
        """Return the horizontal unit vectors (2, 2) from the heel marker to the front and outwards, at ``time`` s."""
        at = np.array([time])
        return np.asarray(self.in_foot(at, np.zeros((1, 2))).axes[0])

    def in_foot(self, time: Array, point: Array) -> InFoot:
        """Return points (n, 2) m in the foot at times (n,) s."""
        (heel, front), speeds = (
            (path[:, :2] for path in self.at(time)),
            [one.speed_at(time)[:, :2] for one in self.tracks],
        )
        length = np.linalg.norm(front - heel, axis=1)
        ahead = (front - heel) / length[:, None]
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        outwards = -1.0 if self.side == "right" else 1.0
        axes = np.stack([ahead, outwards * left], axis=1)
        # Rate of turn to the left: cross product of the markers' relative velocity with the foot's line.
        turns = np.sum(left * (speeds[1] - speeds[0]), axis=1) / length
        # e_i (p - h).
        place = np.einsum("nij,nj->ni", axes, point - heel)
        # d/dt of e_i (p - h) for a fixed p: e_i' (p - h) - e_i h', with ahead' = w left and left' = -w ahead.
        crosses = np.stack([place[:, 1], -place[:, 0]], axis=1) * outwards * turns[:, None]
        return InFoot(axes, place, crosses - np.einsum("nij,nj->ni", axes, speeds[0]), length)

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
    def _velocity(self) -> Track:
        return track_of(self.time, self.velocity)

    def velocity_at(self, time: Array) -> Array:
        """Return the velocity (n, 3) m/s of the middle between the two markers at other times (n,) s."""
        return self._velocity.at(time)

    @cached_property
    def lowest(self) -> Array:
        """(2,) m: the lowest places of the heel marker and of the front in the trial."""
        return np.array([np.nanmin(path[:, 2]) for path in (self.heel, self.front)])

    @cached_property
    def resting(self) -> Array:
        """(2,) m: median heights of the heel marker and the front where the foot goes neither up nor down; NaN where it
        always does.
        """
        flat = np.abs(self.velocity[:, 2]) < 0.1
        return np.array([np.nanmedian(path[flat, 2]) if flat.any() else np.nan for path in (self.heel, self.front)])

    def drift(self, time: Array) -> Array:
        """Return the median velocity (3,) m/s at some times: that of the belt a foot stands on, or nearly none."""
        return median_known(self.velocity_at(time))


def median_known(velocity: Array) -> Array:
    """Return the median (3,) of the rows (n, 3) that are known, NaN without any."""
    known = velocity[np.isfinite(velocity).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.full(3, np.nan)


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
    """Return one foot, its front between the markers on the edges of the forefoot, or inwards of the outer one."""
    inner, outer = (_landmark(markers, set_name, f"{side}_toe_{edge}") for edge in ("medial", "lateral"))
    if any(edge is not None and np.array_equal(toe, edge, equal_nan=True) for edge in (inner, outer)):
        return FootPath(side, markers.time, heel, toe, toe, centred=False)
    if inner is not None and outer is not None:
        return FootPath(side, markers.time, heel, toe, (inner + outer) / 2, by_edges=True)
    found = FootPath(side, markers.time, heel, toe, toe)
    if outer is None or not np.nanmedian(found.in_foot(markers.time, outer[:, :2]).place[:, 1]) > 0:
        return found
    # Perpendicular to the line from heel to edge, towards the inside.
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


_ASIDE = 0.06
"""m from foot to foot that the pressure of who stands still lies from the pelvis at most: 24 mm seen, 0.1 m and more
where one foot alone presses."""


def pressed_between(feet: tuple[FootPath, ...], total: Wrench, pelvis: Array) -> bool:
    """Return whether the ``total`` wrench of somebody who stands still lies under the ``pelvis`` (T, 3) m, seen from
    foot to foot, as far as it is known. Where it lies under one of two ``feet``, the other one is not measured.
    """
    pressure = total.cop(height=min((float(np.nanmin(foot.front[:, 2])) for foot in feet), default=0.0))[:, :2]
    paths = (*(foot.front[:, :2] for foot in feet), pressure, pelvis[:, :2])
    if len(feet) < 2 or not all(np.isfinite(path).all(axis=1).any() for path in paths):
        return True
    left, right, pressed, over = (np.nanmean(path, axis=0) for path in paths)
    return bool(abs((pressed - over) @ (left - right)) <= _ASIDE * np.linalg.norm(left - right))
