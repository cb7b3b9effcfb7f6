"""Does somebody stand still in a trial, when, in which posture, and which mass do the plates carry then? Needed before
anything is known about the person.
"""

from weakref import WeakKeyDictionary

import numpy as np

from biodance.errors import TrialRefused
from biodance.records import Array, Markers, Mask, Trial, Wrench, longest_run
from biodance.settings import STANDARD_GRAVITY, StandingRules

WINDOW = 0.5
"""s: length of the quietest part of the static trial that is averaged."""
_UNSEEN = 0.1
"""m a frame: an unseen marker counts as one that moves so fast."""
_STILL = 0.02
"""m, standard deviation over half a second beyond which a marker does not stand still."""
_BLOCK = 0.05
"""s: the force is averaged over blocks of this length before it is judged."""
_NUMBERS = 1_000_000
"""Numbers ordered at once, so that a long trial needs little memory."""
_MOVEMENT: WeakKeyDictionary[Markers, float] = WeakKeyDictionary()
"""How far markers moved, kept as long as they live: reader, roles and checks ask for it."""
_PLACES = 16
"""As many places in an order are found without ordering all."""


def movement(markers: Markers) -> float:
    """Return how far the typical marker travels in the trial, m: the median over markers of the diagonal of the box it
    stays in.

    The box is taken between the 2nd and 98th percentile of each coordinate, so that a flickering marker does not count
    as movement. NaN if no marker was ever seen.
    """
    if markers not in _MOVEMENT:
        _MOVEMENT[markers] = _movement(markers)
    return _MOVEMENT[markers]


def _movement(markers: Markers) -> float:
    seen = np.flatnonzero(markers.seen.any(axis=0))
    if not seen.size:
        return float("nan")
    some, boxes = max(1, _NUMBERS // (3 * markers.time.size)), []
    for start in range(0, seen.size, some):
        low, high = _percentiles(markers.xyz[:, seen[start : start + some]], 0.02, 0.98)
        boxes.append(np.linalg.norm(high - low, axis=1))
    return float(np.median(np.concatenate(boxes)))


def _percentiles(values: Array, *shares: float) -> list[Array]:
    """Return what the ``shares`` of the numbers along the first axis lie below, (...) each; NaN do not count (as
    `numpy.nanpercentile`, which goes through the columns one by one: 20 times as long).
    """
    last = np.isfinite(values).sum(axis=0) - 1
    places = [share * last for share in shares]
    around = [(np.floor(at).astype(int), np.minimum(np.floor(at).astype(int) + 1, last)) for at in places]
    needed = np.unique(around)
    few = needed.size <= _PLACES and needed[0] >= 0
    ordered = np.partition(values, needed, axis=0) if few else np.sort(values, axis=0)  # NaN last
    found = []
    for at, (below, above) in zip(places, around, strict=True):
        low, high = (np.take_along_axis(ordered, place[None], axis=0)[0] for place in (below, above))
        found.append(low + (at - below) * (high - low))
    return found


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
    """Return the mass in kg that a wrench carries in its longest quiet part, by default within 3 % for 0.4 s; None
    without one.
    """
    quiet = _longest_steady(_blocks(wrench.force[:, 2], wrench.rate), rules or StandingRules())
    return float(quiet.mean() / gravity) if quiet is not None else None


def _blocks(vertical: Array, rate: float) -> Array:
    """Return the vertical force averaged over blocks of 0.05 s."""
    size = max(1, round(_BLOCK * rate)) if np.isfinite(rate) else 1
    count = vertical.size // size
    return vertical[: count * size].reshape(count, size).mean(axis=1)


def _longest_steady(blocks: Array, rules: StandingRules) -> Array | None:
    """Return the longest run of blocks within the sway of their median; None if too short, or of nobody."""
    middle = float(np.nanmedian(blocks)) if np.isfinite(blocks).any() else 0.0
    if not middle >= rules.force:
        return None
    run = blocks[slice(*longest_run(np.abs(blocks - middle) <= rules.sway * middle))]
    return run if run.size and run.size * _BLOCK >= rules.shortest - 1e-9 else None


def quietest(markers: Markers) -> Mask:
    """Return (T,) True for the ``WINDOW`` s in which the markers move least while most of them are seen; all frames
    of a shorter trial.
    """
    frames = markers.time.size
    length = frames if frames < 3 else round(WINDOW * markers.rate)
    if frames <= max(length, 2):
        return np.ones(frames, dtype=bool)
    step = np.linalg.norm(np.diff(markers.xyz, axis=0), axis=2)
    unseen = np.isnan(step)
    cost = np.where(unseen, _UNSEEN, step).sum(axis=1)
    total = np.convolve(cost, np.ones(max(length - 1, 1)), mode="valid")
    start = int(np.argmin(total))
    return np.isin(np.arange(frames), np.arange(start, start + length))


def posture_frames(markers: Markers) -> tuple[Mask, bool]:
    """Return (T,) True for the frames that show one posture, and whether the person stands still in them.

    They are the quietest half second; where nobody stands still, the one frame, among those that show most markers, in
    which the lowest third of the markers is lowest: both feet are on the ground.
    """
    quiet = quietest(markers)
    near = markers.xyz[quiet]
    several = np.isfinite(near).all(axis=2).sum(axis=0) > 1
    if markers.time.size <= 2:
        return quiet, True
    if several.any() and np.nanmedian(np.nanstd(near[:, several], axis=0).max(axis=1)) <= _STILL:
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
