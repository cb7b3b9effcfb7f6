"""Who stands here, and when quietly: a person's right, ahead, floor and stature, told by labels or by the points alone,
and where such a person has landmarks (``anthropometry/standing.toml``).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.markers.names import meanings, meanings_of, plain_labels
from biodance.lab.markers.sets import LANDMARKS, MarkerSet, landmark, part_of, segment_of
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array, Markers, Mask, Trial, Wrench, any_coordinate, longest_run, spread_frames
from biodance.settings import STANDARD_GRAVITY, StandingRules

WINDOW = 0.5
"""s: length of the quietest part of the static trial that is averaged."""
_BLOCK = 0.05  # s: the force is averaged over blocks of this length before it is judged
_MOVEMENT: WeakKeyDictionary[Markers, float] = WeakKeyDictionary()
"""How far markers moved, kept as long as they live: reader, roles and checks ask for it."""


def movement(markers: Markers) -> float:
    """Return how far the typical marker travels in the trial, m: the median over markers of the diagonal of the box it
    stays in.

    The box is taken between the 2nd and 98th percentile of each coordinate, so that a flickering marker does not count
    as movement. NaN if no marker was ever seen.
    """
    if markers not in _MOVEMENT:
        seen = markers.xyz[:, markers.seen.any(axis=0)]
        low, high = np.nanquantile(seen, [0.02, 0.98], axis=0) if seen.size else np.full((2, 1, 3), np.nan)
        _MOVEMENT[markers] = float(np.median(np.linalg.norm(high - low, axis=1)))
    return _MOVEMENT[markers]


def is_still(trial: Trial) -> bool:
    """Return True if the trial has markers and the typical one stays within ``trial.settings.standing.still``."""
    return trial.markers is not None and movement(trial.markers) <= trial.settings.standing.still


def standing_mass(trial: Trial) -> float | None:
    """Return the mass in kg that the plates carry in the longest quiet part (as ``trial.settings.standing`` has it);
    None without one.

    Only for trials in which the markers are still or that have no markers: a walker may have one foot beside the
    plates.
    """
    if not trial.plates or (trial.markers is not None and not is_still(trial)):
        return None
    try:
        return steady_mass(trial.wrench, rules=trial.settings.standing, gravity=trial.settings.gravity)
    except TrialRefused:
        return None


def steady_mass(
    wrench: Wrench, *, rules: StandingRules | None = None, gravity: float = STANDARD_GRAVITY
) -> float | None:
    """Return the mass in kg that a wrench carries in its longest quiet part (3 % for 0.4 s); None without one."""
    vertical = wrench.force[:, 2]
    size = max(1, round(_BLOCK * wrench.rate)) if np.isfinite(wrench.rate) else 1
    count = vertical.size // size
    blocks = vertical[: count * size].reshape(count, size).mean(axis=1)
    quiet = quiet_run(blocks, np.isfinite(blocks), 1 / _BLOCK, rules)
    return float(blocks[quiet].mean() / gravity) if quiet is not None else None


def quiet_run(vertical: Array, used: Mask, rate: float, rules: StandingRules | None = None) -> slice | None:
    """Return the longest run of ``used`` samples (T,) with a steady ``vertical`` force (T,) N, within the sway of its
    median; None if it is too short, or nobody stands there.
    """
    rules = rules or StandingRules()
    middle = float(np.median(vertical[used])) if used.any() else 0.0
    if middle < rules.force:
        return None
    first, stop = longest_run((np.abs(vertical - middle) <= rules.sway * middle) & used)
    return slice(first, stop) if stop - first >= rules.shortest * rate - 1e-9 else None


def _quietest(markers: Markers) -> Mask:
    """Return (T,) True for the ``WINDOW`` s in which the markers move least while most of them are seen."""
    frames = markers.time.size
    length = frames if frames < 3 else round(WINDOW * markers.rate)
    if frames <= max(length, 2):
        return np.ones(frames, dtype=bool)
    step = np.linalg.norm(np.diff(markers.xyz, axis=0), axis=2)
    unseen = np.isnan(step)
    # 0.1 m a frame: an unseen marker counts as one that moves so fast
    cost = np.where(unseen, 0.1, step).sum(axis=1)
    # Sliding sum: a window of `length` frames holds one step less.
    total = np.convolve(cost, np.ones(max(length - 1, 1)), mode="valid")
    start = int(np.argmin(total))
    return np.isin(np.arange(frames), np.arange(start, start + length))


def posture_frames(markers: Markers) -> tuple[Mask, bool]:
    """Return (T,) True for the frames that show one posture, and whether the person stands still in them.

    They are the quietest half second; where nobody stands still, the one frame, among those that show most markers, in
    which the lowest third of the markers is lowest: both feet are on the ground.
    """
    quiet = _quietest(markers)
    near = markers.xyz[quiet]
    several = np.isfinite(near).all(axis=2).sum(axis=0) > 1
    if markers.time.size <= 2:
        return quiet, True
    # A marker that stands still has a standard deviation of 0.02 m at most in half a second.
    if several.any() and np.nanmedian(np.nanstd(near[:, several], axis=0).max(axis=1)) <= 0.02:
        return quiet, True
    height = np.sort(np.where(markers.seen, markers.xyz[:, :, 2], np.inf), axis=1)
    lowest = height[:, : max(1, len(markers.names) // 3)].mean(axis=1)
    unseen = (~markers.seen).sum(axis=1)
    lowest[unseen > unseen.min()] = np.inf
    return np.arange(markers.time.size) == int(np.argmin(lowest)), False


def median_places(markers: Markers, frames: Mask) -> dict[str, Array]:
    """Return label -> (3,) m: the median over some frames (T,) of every marker that is seen in one of them."""
    near = markers.xyz[frames].swapaxes(0, 1)
    seen = np.asarray(np.isfinite(near).all(axis=2))
    paths = zip(markers.names, near, seen, strict=True)
    return {name: np.median(path[there], axis=0) for name, path, there in paths if there.any()}


def on_the_ground(height: Array) -> Mask:
    """Return where markers of feet, ``height`` (..., T) m, are within 0.03 m of their lowest place, below which single
    frames do not count (5th percentile).
    """
    return np.asarray(height < np.nanpercentile(height, 5, axis=-1, keepdims=True) + 0.03)


def as_high_as_ever(height: Array, among: Mask) -> Mask:
    """Return which frames (T,) ``among`` these show a ``height`` (T,) m of somebody upright: within 0.02 m of the
    highest (95th percentile); who squats or bends leans.
    """
    return among & (height > np.nanpercentile(height[among], 95) - 0.02) if among.any() else among


OUTWARDS = {"right": 1.0, "left": -1.0}
"""Sign of a person's right on each side."""
_STRAIGHT = ("asis", "psis", "acromion")
"""Pairs that point right even where one leg is before the other."""
_NEEDED = ("asis", "knee_lateral", "ankle_lateral", "heel", "toe")


@cache
def usual_standing() -> dict[str, Any]:
    """Return where a standing person has landmarks and segments: the tables of ``anthropometry/standing.toml``."""
    return read_toml(locate("anthropometry", "standing"))


def bound(name: str) -> float:
    """Return one of the numbers by which a standing person is told: ``[rules]`` of ``anthropometry/standing.toml``."""
    return float(usual_standing()["rules"][name])


def _height_of(place: str) -> tuple[float, float] | None:
    """Return the usual height of a landmark and how far from it it is believed; None where it has none."""
    part, heights = part_of(place), usual_standing()["heights"]
    return next((pair for key, pair in heights.items() if part == key or part.startswith(f"{key}_")), None)


@dataclass(frozen=True, eq=False)
class Standing:
    """One standing posture: ``at`` label -> (3,) m; ``named`` landmark -> label as far as known; ``right``, ``ahead``
    horizontal unit vectors; ``middle`` (3,) m of the body, above the ankles; ``floor`` m; ``stature`` m.
    """

    at: Mapping[str, Array]
    named: Mapping[str, str]
    right: Array
    ahead: Array
    middle: Array
    floor: float
    stature: float

    def shares(self, labels: Iterable[str]) -> Array:
        """Return (N, 3) of markers, in shares of the stature: right of the middle, ahead of it, above the floor."""
        xyz = np.array([self.at[label] for label in labels]).reshape(-1, 3) - [*self.middle[:2], self.floor]
        # Into the person's axes, then over the stature.
        return np.asarray(xyz @ np.stack([self.right, self.ahead, [0.0, 0.0, 1.0]]).T / self.stature)

    def misfit(self, place: str, label: str) -> float:
        """Return how far a marker is from a landmark's usual height: 1 where hardly believed; 0 if untold."""
        usual = _height_of(place)
        return float(abs(self.shares([label])[0, 2] - usual[0]) / usual[1]) if usual else 0.0

    def believed(self, place: str, label: str) -> bool:
        """Return whether a marker stands where a person may have this landmark or segment: as high, on its side, heel
        and toes behind and before their ankle, arms within reach of their shoulder.
        """
        side, part, usual = place.partition("_")[0], part_of(place), usual_standing()
        out, ahead, high = self.shares([label])[0]
        lowest, highest = usual["between"].get(part, (-np.inf, np.inf))
        if not lowest <= high <= highest or self.misfit(place, label) > 1:
            return False
        if side not in SIDES:
            return bool(abs(out) < bound("off_middle")) or place.startswith("head") or _height_of(place) is None
        own = OUTWARDS[side] * out
        on_the_side = part.startswith(("asis", "knee", "ankle", "heel", "toe", "acromion"))
        if own >= usual["widest"].get(part, np.inf) or (own <= -bound("across") and on_the_side):
            return False
        ankle, shoulder = (self.named.get(f"{side}_{end}", label) for end in ("ankle_lateral", "acromion"))
        _, before, lifted = self.shares([ankle])[0]
        if part.startswith(("heel", "toe")) and ankle != label and lifted < bound("lifted"):
            return bool(ahead < before if part == "heel" else ahead - before > bound("across"))
        reach = next((span for key, span in usual["reach"].items() if part.startswith(key)), None)
        away = float(np.linalg.norm(self.at[label] - self.at[shoulder])) / self.stature
        return reach is None or shoulder == label or bool(reach[0] <= away <= reach[1])


def _from_left_to_right(known: Mapping[str, Array]) -> dict[str, Array]:
    """Return the vectors (3,) m from the left to the right landmark of each pair of which both are known."""
    parts = (*_STRAIGHT, "knee_lateral", "ankle_lateral", "heel", "toe", "toe_lateral")
    paired = [part for part in parts if known.keys() >= {f"right_{part}", f"left_{part}"}]
    return {part: known[f"right_{part}"] - known[f"left_{part}"] for part in paired}


def _stature(known: Mapping[str, Array], floor: float) -> float:
    """Return the stature, m, that the usual heights of landmarks above the ankle tell (median); 0 without one."""
    usual = [(place[2], _height_of(name)) for name, place in known.items()]
    statures = [(high - floor) / pair[0] for high, pair in usual if pair and pair[0] > 0.2]
    return float(np.median(statures)) if statures else 0.0


def standing_by_names(at: Mapping[str, Array], named: Mapping[str, str]) -> Standing | str | None:
    """Return the standing person that labelled points show, a sentence if nobody stands so, None if the names are too
    few.

    ``at`` label -> (3,) m, z up; ``named`` landmark -> label.
    """
    known = {place: at[label] for place, label in named.items()}
    pairs = _from_left_to_right(known)
    # Landmarks before others, of the same side where both have one.
    front_and_back = (("toe", "{}_heel"), ("toe_lateral", "{}_heel"), ("asis", "{}_psis"), ("asis", "mid_psis"))
    ends = [(f"{side}_{front}", back.format(side)) for side in SIDES for front, back in front_and_back]
    ahead = [known[front] - known[back] for front, back in ends if known.keys() >= {front, back}]
    if len(pairs) < 3 or not ahead:
        return None
    straight = [pairs[part] for part in _STRAIGHT if part in pairs] or list(pairs.values())
    right = np.sum(straight, axis=0) * [1.0, 1.0, 0.0]
    right = right / max(float(np.linalg.norm(right)), 1e-9)
    # Up x right is ahead.
    forward = np.cross([0.0, 0.0, 1.0], right)
    if np.mean([step @ forward > 0 for step in ahead]) < 0.5:
        return (
            "The labels say right where the person has the left: toes and iliac spines would point backwards. Are the "
            "sides exchanged, or is z not up?"
        )
    if any(pair @ right <= 0 for pair in pairs.values()):
        return "Of some pairs of markers the right one lies left of the left one: the sides are exchanged in part."
    feet = [place[2] for name, place in known.items() if part_of(name).startswith(("heel", "toe"))]
    floor = float(min(feet or (at[label][2] for label in plain_labels(at)))) - 0.02
    stature = _stature(known, floor)
    if not 0.6 < stature < 2.6:
        return f"Nobody stands upright here: the labels would make a person of {stature:.2f} m."
    return Standing(at, named, right, forward, _middle(known, pairs, forward, stature), floor, stature)


def _middle(known: Mapping[str, Array], pairs: Iterable[str], forward: Array, stature: float) -> Array:
    """Return the middle (3,) m of the body between its iliac spines, moved ``forward`` until it is above the ankles."""
    parts = list(pairs)
    both = [part for part in _STRAIGHT[:2] if part in parts] or parts
    middle = np.mean([known[f"{side}_{part}"] for part in both for side in SIDES], axis=0)
    ankles, spines = (
        [known[place] for side in SIDES if (place := f"{side}_{part}") in known] for part in ("ankle_lateral", "asis")
    )
    ahead_of_ankles = usual_standing()["places"]["asis"]["at"][1] * stature * forward
    above = np.mean(ankles, axis=0) if len(ankles) == 2 else np.mean(spines or [middle], axis=0) - ahead_of_ankles
    # Only along the way ahead: the middle between the sides stays.
    return np.asarray(middle + (above - middle) @ forward * forward)


def standing_by_points(at: Mapping[str, Array]) -> Standing | None:
    """Return who stands in the points ``at`` label -> (3,) m, z up, without reading a label; None where nobody stands
    straight, or where front and back cannot be told.

    A standing person is nearly symmetric, and has knees, ankles, heels, toes and iliac spines at shares of the stature
    that hardly differ between people.
    """
    plane = _plane_between(np.array(list(at.values())).reshape(-1, 3))
    ways = [_fitted(at, sign * plane[0], sign * plane[1]) for sign in (1.0, -1.0)] if plane else []
    fits = sorted((fit for fit in ways if fit is not None), key=lambda fit: fit[0])
    if not fits or (len(fits) > 1 and fits[1][0] - fits[0][0] < bound("ways")):
        return None
    return fits[0][1]


def mirror_images(stand: Standing) -> list[tuple[str, str]]:
    """Return the pairs of labels (right, left) of which each lies nearest to the mirror image of the other."""
    labels, xyz = list(stand.at), np.array(list(stand.at.values()))
    # Signed distance from the plane between the sides.
    out = (xyz - stand.middle) @ stand.right
    away = _mirrored(xyz, stand.right, float(stand.middle @ stand.right))
    nearest = away.argmin(axis=1)
    return [
        (labels[i], labels[j])
        for i, j in enumerate(nearest)
        if nearest[j] == i and i != j and away[i, j] < bound("paired_m") and out[i] > out[j]
    ]


def _plane_between(xyz: Array) -> tuple[Array, float] | None:
    """Return the unit vector (3,) across the body and its middle, m: the plane that mirrors most; or None."""
    step = xyz[:, None] - xyz[None]
    flat = np.hypot(step[..., 0], step[..., 1])
    first, second = np.nonzero(np.triu((np.abs(step[..., 2]) < bound("level_m")) & (flat > bound("wide_m"))))
    best, plane = 0.0, None
    level = np.argsort(np.abs(step[first, second, 2]))[: int(bound("tried"))]
    for i, j in zip(first[level], second[level], strict=True):
        axis = step[i, j] * [1.0, 1.0, 0.0] / flat[i, j]
        offset = float((xyz[i] + xyz[j]) @ axis / 2)
        # Full score for a marker near its mirror image, none from one and a half times the bound.
        here = float(np.clip(1.5 - _mirrored(xyz, axis, offset).min(axis=1) / bound("paired_m"), 0.0, 1.0).sum())
        if here > best:
            best, plane = here, (axis, offset)
    if plane is None or best < bound("half") * len(xyz):
        return None
    axis, offset = plane
    away = _mirrored(xyz, axis, offset)
    one = np.flatnonzero((away.min(axis=1) < bound("paired_m")) & (xyz @ axis > offset + bound("wide_m") / 4))
    if not one.size:
        return plane
    # The plane in the middle of all pairs, not of the one that it was found by.
    other = away.argmin(axis=1)[one]
    # Vectors from each to its image all lie across the body: their sum is the mean direction.
    across = (xyz[one] - xyz[other]).sum(axis=0) * [1.0, 1.0, 0.0]
    across = across / np.linalg.norm(across)
    return across, float(np.median((xyz[one] + xyz[other]) @ across / 2))


def _mirrored(xyz: Array, axis: Array, offset: float) -> Array:
    """Return (N, N) m from the mirror image of every marker to every marker."""
    # Reflection: x - 2 (x n - d) n.
    image = xyz - 2 * (xyz @ axis - offset)[:, None] * axis
    away: Array = np.linalg.norm(image[:, None] - xyz[None], axis=2)
    return away


def _fitted(at: Mapping[str, Array], right: Array, offset: float) -> tuple[float, Standing] | None:
    """Return how ill a person fits who has the right in this direction, and that person; None if none does."""
    xyz = np.array(list(at.values()))
    ahead = np.cross([0.0, 0.0, 1.0], right)
    out, along, up = xyz @ right - offset, xyz @ ahead, xyz[:, 2]
    person = np.hypot(out, along - np.median(along)) < bound("reach_m")
    low = float(up[person].min()) if person.any() else 0.0
    best = (float("inf"), 0.0, 0.0)
    for stature in np.geomspace(0.85, 2.15, 40):
        shares = np.stack([out, along, up - low], axis=1) / stature + [0.0, 0.0, bound("sole")]
        lateral = person & (np.abs(shares[:, 2] - 0.044) < 0.02) & (np.abs(shares[:, 0]) > 0.05)
        origins = np.unique(along[lateral].round(2))
        if origins.size:
            misfits = _misfit(shares, origins[:, None] / stature)
            best = min(best, (float(misfits.min()), float(stature), float(origins[int(misfits.argmin())])))
    ill, stature, origin = best
    if ill > bound("near") * len(_NEEDED):
        return None
    return ill, Standing(at, {}, right, ahead, right * offset + ahead * origin, low - bound("sole") * stature, stature)


def _misfit(shares: Array, origin: Array) -> Array:
    """Return (O,) the sum of squared sds of the nearest markers (N, 3) from needed landmarks, each bounded."""

    def nearest(part: str, side: float) -> Array:
        usual = usual_standing()["places"][part]
        here = (side * shares[:, 0], shares[:, 1] - origin, shares[:, 2])
        steps = [((x - at) / sd) ** 2 for x, at, sd in zip(here, usual["at"], usual["sd"], strict=True)]
        # Nearest marker to the landmark (axis 1), for every origin (axis 0).
        found: Array = (steps[0] + steps[1] + steps[2]).min(axis=1)
        return found

    near = [nearest(part, side) for part in _NEEDED for side in OUTWARDS.values()]
    behind = np.minimum(nearest("psis", 1.0), nearest("mid_psis", 1.0))
    trunk = shares[np.abs(shares[:, 0]) < 0.12]
    over = max(float(trunk[:, 2].max(initial=0.0)) - 1.03, 0.0) / 0.02
    # Each bounded: one landmark that is missing does not decide.
    return np.asarray(np.minimum([*near, behind], 2 * bound("near")).sum(axis=0) + over**2)


def axis_to_head(markers: Markers, known: MarkerSet | None) -> Array | None:
    """Return the signed coordinate axis (3,) from the feet to the head or pelvis in most frames, by what labels say of
    high and low markers; where they say nothing, the only way up in which somebody stands. None if neither tells it.
    ``known`` is the set of the labels (`recognise`).
    """
    few = Markers(markers.names, spread_frames(markers.time), spread_frames(markers.xyz))
    upper = ("head_front", "head_back", "c7", "jugular_notch", "mid_psis", "right_asis", "left_asis")
    lower = ("right_heel", "left_heel", "right_toe", "left_toe", "right_ankle_lateral", "left_ankle_lateral")
    ends = [
        [p for name in names if known and (p := landmark(few, known, name)) is not None] for names in (upper, lower)
    ]
    if not all(ends):
        # Read in the whole set or, where that says nothing, alone: sides do not matter.
        together = meanings_of(markers.names)
        said = {label: together.get(label) or meanings(label) for label in markers.names}
        on = {label: ways[0].place for label, ways in said.items() if ways}
        on = {label: segment_of(place) if place in LANDMARKS else place for label, place in on.items()}
        groups = (("trunk_head", "pelvis"), ("right_foot", "left_foot", "right_shank", "left_shank"))
        ends = [[few[label] for label in on if on[label] in group] for group in groups]
    if not all(ends):
        return _only_way_to_stand(markers)
    top, bottom = (np.concatenate(points) for points in ends)
    if not (np.isfinite(top).any() and np.isfinite(bottom).any()):
        return None
    return clear_axis(np.nanmedian(top, axis=0) - np.nanmedian(bottom, axis=0))


def _only_way_to_stand(markers: Markers) -> Array | None:
    """Return the signed axis (3,) along which alone the points are a standing person; None if none or several are."""
    points = median_places(markers, _quietest(markers))
    at = {label: points[label] for label in plain_labels(points)}
    if len(at) < bound("cloud"):
        return None
    # Without the outermost points, which need not be on the person.
    extent = np.ptp(np.percentile(list(at.values()), (5, 95), axis=0), axis=0)
    found = []
    for up in (
        sign * np.eye(3)[k] for k in np.flatnonzero(extent > bound("tall") * extent.max()) for sign in (1.0, -1.0)
    ):
        # Any axis across: a right-handed frame whose third axis points up.
        first = np.roll(np.abs(up), 1)
        turned = np.stack([first, np.cross(up, first), up])
        if standing_by_points({label: turned @ point for label, point in at.items()}) is not None:
            found.append(up)
    return found[0] if len(found) == 1 else None


def clear_axis(direction: Array) -> Array | None:
    """Return the signed coordinate axis that a direction (3,) clearly follows; None if none."""
    size = np.sort(np.abs(direction))
    if not np.isfinite(size).all() or size[2] <= bound("clear") * size[1]:
        return None
    i = int(np.argmax(np.abs(direction)))
    axis: Array = np.eye(3)[i] * np.sign(direction[i])
    return axis


def turn_to(up: Array) -> Array:
    """Return the rotation (3, 3) whose third row is a coordinate axis ``up``; its first row is x where possible."""
    first = np.array([1.0, 0.0, 0.0]) if up[0] == 0 else np.array([0.0, 1.0, 0.0])
    # Right-handed: first x (up x first) = up. Adding zero makes no -0.0.
    return np.stack([first, np.cross(up, first), up]) + 0.0


METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""Units in which laboratories write lengths, m."""
PERSON_SPAN = 1.5
"""m, largest extent of the markers on a person: 0.9 for legs alone to 2.3 with arms spread or raised."""


def likely_unit(size: float, metres: float = PERSON_SPAN) -> str:
    """Return the unit of `METRES` in which a ``size`` comes nearest to so many ``metres``."""
    return min(METRES, key=lambda unit: abs(np.log(size * METRES[unit] / metres)))


def extents(xyz: Array, least: int) -> Array:
    """Return the sides (n, 3) of the box about markers (T, K, 3) in each of the frames that show ``least`` of them."""
    frames = xyz[(~any_coordinate(~np.isfinite(xyz))).sum(axis=1) >= least]
    return np.asarray(np.nanmax(frames, axis=1) - np.nanmin(frames, axis=1)) if len(frames) else np.empty((0, 3))


def body_is_tall_along_z(xyz: Array) -> bool:
    """Return True if the marker cloud (T, K, 3) is clearly taller along the third axis than along the second.

    The extent is taken frame by frame and its median over time is compared, so that walking does not count as height;
    arms that are spread sideways stay below 1.3 times the stature. A single marker has no extent: the answer is then
    False.
    """
    sides = extents(xyz, 2)
    if not len(sides):
        return False
    extent = np.median(sides, axis=0)
    return bool(extent[2] > 1.3 * extent[1])
