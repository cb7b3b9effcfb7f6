"""Newton's second law for a whole person: the plates carry m (g + a) of the centre of mass, and nothing else; in quiet
standing, the mass and where its centre is.

The mean of the markers of pelvis and trunk goes nearly as the centre of mass does: when the force comes against it, and
what it weighs over a second or more, needs no body, no joint and no posture. How well the two go together
(`LagAndMass.correlation`) says how far that holds. Only frames count in which every foot that may touch anything stands
over plates.
"""

from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.lab.markers.upright import movement, quiet_run
from biodance.lab.prepare import LowPass, low_pass, prepare
from biodance.motion.contact import carried_elsewhere, feet_on_ground
from biodance.motion.kinematics import centre_of_mass, in_blocks, poses
from biodance.motion.soles import footing, soles_from_markers
from biodance.records import Array, Markers, Mask, Motion, Trial, Wrench, runs

TELLS = 0.7
"""Least correlation of force and acceleration that tells anything: with a chair that carries along it is 0.4 to 0.6, in
23 clean trials of 15 laboratories 0.9 to 0.999."""
_BAND = LowPass(order=2, cutoff=6.0)
"""Of force and acceleration: steps and squats are below (Winter 2009, chapter 3), impacts of single limbs above."""
_FARTHEST, _STEP = 0.5, 0.002  # s: how late or early a force is looked for, and in which steps
_WHOLE, _NEAR = 0.5, 0.06
"""s that a step takes, and how far a lag is looked for in less: of half a step every bend of the force looks like
another one, and only the one beside it is told."""
_EDGE = 0.1  # s at each end of the markers, which the low-pass makes up
_LEAST = 0.25  # s without a break that are looked at
_MOVES = 0.01
"""Share of the mean force by which it must swing to show an instant: 0.3 mm of noise in each of eight markers is 0.7 %
of g at 4 Hz."""
_AMBIGUOUS = 1.5
"""Times the least rest: of steps that are all alike the instant nearest to none is believed."""
_WEIGHS, _FADES = 0.5, 0.3
"""s without a break that weigh, and the share of them in which their weights begin, and end."""
_WEIGHED, _UNLIKE = 0.002, 0.25
"""Of the mass, as a share: sd of what a plate weighs in quiet standing; and of the mean acceleration by which the trunk
goes unlike the centre of mass (slope of force against acceleration: 0.75 to 0.85 of the mass in squats and in running).
"""
_TRUNKS: "WeakKeyDictionary[Trial, tuple[float, Trunk | None]]" = WeakKeyDictionary()
"""The trunk of a trial with the mass it was asked for, kept as long as the trial lives: checks and observers ask."""


@dataclass(frozen=True, eq=False)
class Trunk:
    """The mean of a trial's pelvis and trunk markers: ``time`` (T,) s, ``height`` (T,) m, ``acceleration`` (T,) m/s²
    upwards below 6 Hz, and whether plates alone can carry the person, ``covered`` (T,).
    """

    time: Array
    height: Array
    acceleration: Array
    covered: Mask
    _known: dict[tuple[float, int, int], "LagAndMass | None"] = field(default_factory=dict, init=False, repr=False)

    @property
    def rate(self) -> float:
        """Hz of the markers."""
        return 1 / float(np.median(np.diff(self.time)))

    def spans(self, least: float) -> list[slice]:
        """Return the frames, ``least`` s or longer without a break, in which plates alone can carry the person."""
        return [slice(*run) for run in runs(self.covered) if run[1] - run[0] >= least * self.rate]

    def weights(self, gravity: float) -> list[tuple[slice, Array, float]]:
        """Return the frames that weigh, the factors (n,) s²/m from force to mass, and its relative sd."""
        found = []
        for span in self.spans(_WEIGHS):
            weight, bend = fading(self.time[span])
            height = self.height[span]
            # Mean of the acceleration from places alone: integrated twice by parts onto the weights.
            acceleration = float(bend @ (height - height.mean()))
            sd = float(np.hypot(_WEIGHED, _UNLIKE * acceleration / gravity))
            found.append((span, weight / (gravity + acceleration), sd))
        return found

    def beside(self, total: Wrench, *, gravity: float, sway: float) -> "LagAndMass | None":
        """Return what Newton tells of the ``total`` wrench of all plates, see `_lag_and_mass`; the last ones are kept:
        a plate that is moved or turned changes no vertical force.
        """
        vertical = total.force[:, 2]
        key = float(total.time[0]), vertical.size, hash(vertical.tobytes())
        if key not in self._known:
            self._known[key] = _lag_and_mass(self, total.time, vertical, gravity=gravity, sway=sway)
        return self._known[key]


@dataclass(frozen=True)
class LagAndMass:
    """``lag`` s of the force behind the trunk's acceleration, and ``mass`` kg, each with its standard deviation (NaN:
    not told); their ``correlation``, at the ``unmoved`` instant too, over so many ``seconds``; ``swing``: the standard
    deviation of the force as a share of its mean.
    """

    lag: float
    lag_sd: float
    mass: float
    mass_sd: float
    correlation: float
    unmoved: float
    seconds: float
    swing: float


def newton_of(trial: Trial, *, mass: float) -> LagAndMass | None:
    """Return what Newton tells of a trial as read, or prepared; None where it holds no trunk, no plates, or plates of
    different clocks. ``mass`` kg of the person, NaN = unknown: without it a chair that carries is not seen.
    """
    trunk = trunk_of(trial, mass=mass)
    if trunk is None or any(not np.array_equal(p.wrench.time, trial.plates[0].wrench.time) for p in trial.plates):
        return None
    return trunk.beside(trial.wrench, gravity=trial.settings.gravity, sway=trial.settings.standing.sway)


def trunk_of(trial: Trial, *, mass: float) -> Trunk | None:
    """Return the trunk of a trial as read, or prepared; None without a marker set, pelvis, feet or plates."""
    known = _TRUNKS.get(trial)
    if known is None or not np.array_equal(known[0], mass, equal_nan=True):
        known = _TRUNKS[trial] = mass, _trunk(trial, mass)
    return known[1]


def _trunk(trial: Trial, mass: float) -> Trunk | None:
    if trial.markers is None or not trial.plates or not trial.marker_set:
        return None
    try:
        one = prepare(trial)
        assert one.markers is not None
        path = _height(one)
        if path is None or one.markers.time.size < 4:
            return None
        slow = low_pass(path, one.markers.rate, _BAND)
        covered = _covered(one, mass)
    except BiodanceError:
        return None
    time = one.markers.time
    acceleration = np.gradient(np.gradient(slow, time), time)
    covered &= (time > time[0] + _EDGE) & (time < time[-1] - _EDGE) & np.isfinite(acceleration)
    return Trunk(time, path, acceleration, covered)


def _height(trial: Trial) -> Array | None:
    """Return the height (T,) m of the middle between pelvis and trunk; None without one of them."""
    assert trial.markers is not None
    segment = {marker.label: marker.segment for marker in read_marker_set(trial.marker_set).markers}
    heights = []
    for wanted in ("pelvis", "trunk_head"):
        of = [k for k, name in enumerate(trial.markers.names) if segment.get(name) == wanted]
        seen = trial.markers.xyz[:, of, 2]
        seen = seen[:, np.isfinite(seen).all(axis=0)]
        if seen.shape[1]:
            heights.append(seen.mean(axis=1))
    return np.mean(heights, axis=0) if heights else None


def _covered(trial: Trial, mass: float) -> Mask:
    """Return (T,) where every foot of a prepared trial that may touch anything is over plates, by the markers."""
    assert trial.markers is not None
    soles = soles_from_markers(trial.markers, read_marker_set(trial.marker_set))
    feet = feet_on_ground(trial, soles, mass=mass)
    place = footing(trial.plates, soles, feet.surfaces, feet.touching, feet.load)
    beside = np.any((feet.touching & ~place.covered) | place.unseen, axis=1)
    return np.asarray(~beside & ~carried_elsewhere(trial, weight=feet.weight))


def _lag_and_mass(trunk: Trunk, time: Array, vertical: Array, *, gravity: float, sway: float) -> LagAndMass | None:
    """Return what Newton tells of the vertical force (S,) N at times (S,) s; None where too little is covered."""
    known = np.isfinite(vertical)
    rate = 1 / float(np.median(np.diff(time))) if time.size > 1 else 0.0
    if rate <= 2 * _BAND.cutoff or time.size < 2 * _BAND.shortest(rate) or not known.all():
        return None
    spans = trunk.spans(_LEAST)
    if not spans:
        return None
    here = np.concatenate([np.arange(span.start, span.stop) for span in spans])
    slow = low_pass(vertical, rate, _BAND)
    force = np.interp(trunk.time[here], time, slow)
    swing = float(force.std() / max(abs(float(force.mean())), 1e-9))
    lag, lag_sd, correlation, unmoved = _lag(trunk, here, time, slow)
    if swing < _MOVES:
        lag = lag_sd = float("nan")
    force = np.interp(trunk.time + (lag if np.isfinite(lag) else 0.0), time, slow)
    mass = mass_sd = float("nan")
    if correlation >= TELLS or swing <= sway:
        mass, mass_sd = _mass(trunk, force, gravity)
    seconds = here.size / trunk.rate
    return LagAndMass(lag, lag_sd, mass, mass_sd, correlation, unmoved, seconds, swing)


def _lag(trunk: Trunk, here: Array, time: Array, slow: Array) -> tuple[float, float, float, float]:
    """Return lag and its sd s (NaN: not told), the correlation there, and the one at no lag."""
    lasts = here.size / trunk.rate
    farthest = min(_FARTHEST, lasts / 2) if lasts >= _WHOLE else _NEAR
    lags = _STEP * np.arange(-round(farthest / _STEP), round(farthest / _STEP) + 1)
    wanted = trunk.acceleration[here] - trunk.acceleration[here].mean()
    found = np.stack([np.interp(trunk.time[here] + lag, time, slow) for lag in lags])
    found -= found.mean(axis=1, keepdims=True)
    # Pearson's correlation at every lag, both about their means.
    size = np.linalg.norm(found, axis=1) * np.linalg.norm(wanted)
    alike = found @ wanted / np.where(size > 0, size, np.inf)
    peaks = np.flatnonzero((alike[1:-1] >= alike[:-2]) & (alike[1:-1] >= alike[2:])) + 1
    unmoved = float(alike[lags.size // 2])
    if not peaks.size or alike[peaks].max() < TELLS:
        return float("nan"), float("nan"), float(alike.max()), unmoved
    # Share of the force that the acceleration does not explain.
    rest = 1 - alike[peaks] ** 2
    near = peaks[rest <= _AMBIGUOUS * rest.min()]
    k = near[np.argmin(np.abs(lags[near]))]
    bend = alike[k - 1] - 2 * alike[k] + alike[k + 1]
    # Top of the parabola through three correlations.
    lag = lags[k] + (0.5 * _STEP * (alike[k - 1] - alike[k + 1]) / bend if bend < 0 else 0.0)
    slope = found[k] @ wanted / (wanted @ wanted)
    left, moves = found[k] - slope * wanted, np.gradient(slow, time)
    # A lag changes the force by its rate: what is left over the rate, over the root of independent samples.
    steep = float(np.interp(trunk.time[here] + lag, time, moves).std())
    # A signal below f Hz has 2 f independent samples a second.
    independent = 2 * _BAND.cutoff * here.size / trunk.rate
    return float(lag), float(left.std() / steep / independent**0.5), float(alike[k]), unmoved


def _mass(trunk: Trunk, force: Array, gravity: float) -> tuple[float, float]:
    """Return the mass kg and its sd by the force (T,) N, spans weighted by their own sd; NaN without one that weighs
    anything.
    """
    told = [(float(weight @ force[span]), sd) for span, weight, sd in trunk.weights(gravity)]
    masses, relative = np.array([one for one in told if one[0] > 0]).reshape(-1, 2).T
    if not masses.size:
        return float("nan"), float("nan")
    # Inverse variances: relative sd times the mass that each span weighs.
    share = (masses * relative) ** -2
    return float(share @ masses / share.sum()), float(max(share.sum() ** -0.5, _WEIGHED * np.mean(masses)))


def slopes_of(trunk: Trunk, told: LagAndMass, total: Wrench, changes: Array, *, gravity: float) -> tuple[Array, Array]:
    """Return the derivatives of lag and mass of `_lag_and_mass` with respect to the sizes (d,) of ``changes`` (S, d) N
    of the total vertical force; 0 of what is not told.

    The lag is the top of the parabola through three correlations: its derivative is that of the three. The mass changes
    with the forces, with the lag, and with what each span weighs among all.
    """
    rate = 1 / float(np.median(np.diff(total.time)))
    slow = low_pass(np.column_stack([total.force[:, 2], changes]), rate, _BAND)
    slow = np.column_stack([slow, np.gradient(slow[:, 0], total.time)])
    lags, masses = np.zeros(changes.shape[1]), np.zeros(changes.shape[1])
    if np.isfinite(told.lag):
        lags = _lag_slope(trunk, total.time, slow[:, :-1], told.lag)
    weights = trunk.weights(gravity) if np.isfinite(told.mass) else []
    times = trunk.time + (told.lag if np.isfinite(told.lag) else 0.0)
    each = np.array([weight @ _at(times[span], total.time, slow) for span, weight, _ in weights])
    if len(each):
        share = (np.abs(each[:, 0]) * [sd for *_, sd in weights]) ** -2
        share /= share.sum()
        # Weights go with mass^-2: d(mean) / d m_i = share_i (1 - 2 (m_i - mean) / m_i).
        share *= 1 - 2 * (each[:, 0] - told.mass) / each[:, 0]  # a heavier span weighs less among all
        masses = share @ (each[:, 1:-1] + np.outer(each[:, -1], lags))
    return lags, masses


def _lag_slope(trunk: Trunk, time: Array, slow: Array, lag: float) -> Array:
    """Return the derivatives (d,) of the lag with respect to the columns of ``slow`` (S, 1 + d) after the first."""
    here = np.concatenate([np.arange(span.start, span.stop) for span in trunk.spans(_LEAST)])
    wanted = trunk.acceleration[here] - trunk.acceleration[here].mean()
    alike, slopes = [], []
    for near in _STEP * (round(lag / _STEP) + np.arange(-1, 2)):
        found = _at(trunk.time[here] + near, time, slow)
        found -= found.mean(axis=0)
        force, changed = found[:, 0], found[:, 1:]
        size = np.linalg.norm(force) * np.linalg.norm(wanted)
        alike.append(force @ wanted / size)
        # d of f.w / (|f| |w|): through the product, less through the length of f.
        slopes.append(wanted @ changed / size - alike[-1] * (force @ changed) / (force @ force))
    bend, bends = np.diff(alike, 2)[0], np.diff(slopes, 2, axis=0)[0]
    fall, falls = alike[0] - alike[2], slopes[0] - slopes[2]
    # Quotient rule of fall / bend.
    return np.asarray(0.5 * _STEP * (falls - fall / bend * bends) / bend) if bend < 0 else np.zeros_like(falls)


def _at(time: Array, known: Array, values: Array) -> Array:
    """Return columns (S, k) at other times (n,) s, straight between samples."""
    return np.stack([np.interp(time, known, column) for column in values.T], axis=1)


def fading(time: Array) -> tuple[Array, Array]:
    """Return the share (n,) of each of the times (n,) s in a mean whose weights begin and end as a cosine does, and
    the factors (n,) 1/s² by which places give the same mean of their acceleration: the weights' second derivative.
    """
    lasts = time[-1] - time[0]
    edge = np.minimum((time - time[0]) / lasts, (time[-1] - time) / lasts) / _FADES
    # Raised cosine: weight and slope are zero at both ends, so no boundary term is left.
    weight = np.where(edge < 1, 0.5 * (1 - np.cos(np.pi * edge)), 1.0)
    bend = np.where(edge < 1, 0.5 * (np.pi / (_FADES * lasts)) ** 2 * np.cos(np.pi * edge), 0.0)
    # Trapezoidal rule: half the way to either neighbour (twice, the factor cancels in the ratio).
    width = np.diff(time, prepend=time[:1]) + np.diff(time, append=time[-1:])
    total = width @ weight
    return width * weight / total, width * bend / total


_FOOT_LANDMARKS = tuple(
    f"{side}_{place}" for side in ("left", "right") for place in ("heel", "toe", "ankle_lateral", "toe_lateral")
)


_PART = 1.0
"""s: shorter parts of a steady run are not looked at: in this time the typical marker gains less than 0.06 m/s,
which is 0.6 % of the weight.
"""


@dataclass(frozen=True, eq=False)
class QuietStanding:
    """A quiet standing on the plates from ``start`` to ``end`` s; ``mass`` kg on the plates (mean vertical force / g),
    ``mass_sd`` kg.

    ``cop`` and ``com`` (T, 2) m, horizontal lab coordinates of the centre of pressure and of the table's centre of mass
    (``com`` empty without a tracked motion); ``forward`` (2,) unit vector the subject faces; ``com_ahead``,
    ``com_left`` m: mean of CoM minus CoP along it and to its left; ``feet`` (F, 2) m foot landmarks and their
    ``foot_names`` (``left_heel`` ...); ``plates`` (P, 4, 2) m corners.
    """

    trial: str
    start: float
    end: float
    mass: float
    mass_sd: float
    cop: Array
    com: Array
    forward: Array
    com_ahead: float
    com_left: float
    feet: Array
    foot_names: tuple[str, ...]
    plates: Array


def facing(body: Body, motion: Motion) -> Array:
    """Return the horizontal unit vector (2,) along which the pelvis faces on average (its x axis, anterior)."""
    ahead = np.sum([poses(body, part.q).rotation[:, 0, :2, 0].sum(axis=0) for _, part in in_blocks(motion)], axis=0)
    return np.asarray(ahead / np.linalg.norm(ahead))


def _feet(trial: Trial, run: slice) -> tuple[tuple[str, ...], Array]:
    """Return names and mean horizontal places (F, 2) m of the foot landmarks that the marker set knows."""
    if trial.markers is None or not trial.marker_set:
        return (), np.empty((0, 2))
    marker_set = read_marker_set(trial.marker_set)
    found = {name: landmark(trial.markers, marker_set, name) for name in _FOOT_LANDMARKS}
    places = {
        name: np.nanmean(path[run, :2], axis=0)
        for name, path in found.items()
        if path is not None and np.isfinite(path[run]).any()
    }
    return tuple(places), np.array(list(places.values())).reshape(-1, 2)


def _still_part(markers: Markers | None, run: slice, rate: float, within: float) -> slice | None:
    """Return the longest part of ``run``, halved down to `_PART` s, with the typical marker ``within`` m; or None."""
    if markers is None:
        return run
    length = run.stop - run.start
    while True:
        for start in range(run.start, run.stop - length + 1, length):
            part = slice(start, start + length)
            if movement(Markers(markers.names, markers.time[part], markers.xyz[part])) <= within:
                return part
        length //= 2
        if length < _PART * rate:
            return None


def quiet_standing(
    trial: Trial, used: NDArray[np.bool_], body: Body | None, motion: Motion | None
) -> QuietStanding | None:
    """Return the quiet standing of a prepared trial, in the longest steady run of the frames ``used`` (T,); None
    without one.

    Steady means the vertical force, and the markers where there are any: walking, too, loads the plates evenly for a
    moment.
    """
    wrench, rules = trial.wrench, trial.settings.standing
    run = quiet_run(wrench.force[:, 2], used, wrench.rate, rules)
    run = _still_part(trial.markers, run, wrench.rate, rules.still) if run is not None else None
    if run is None:
        return None
    cop = wrench.cop(height=trial.floor)[run, :2]
    com, ahead = np.empty((0, 2)), np.array([1.0, 0.0])
    if body is not None and motion is not None:
        com, ahead = centre_of_mass(body, motion)[run, :2], facing(body, motion)
    arm = com.mean(axis=0) - cop.mean(axis=0) if com.size else np.full(2, np.nan)
    mass = wrench.force[run, 2] / trial.settings.gravity
    names, feet = _feet(trial, run)
    return QuietStanding(
        trial=trial.name,
        start=float(wrench.time[run][0]),
        end=float(wrench.time[run][-1]),
        mass=float(mass.mean()),
        mass_sd=float(mass.std()),
        cop=cop,
        com=com,
        forward=ahead,
        com_ahead=float(arm @ ahead),
        # Left of forward is (-y, x).
        com_left=float(arm @ np.array([-ahead[1], ahead[0]])),
        feet=feet,
        foot_names=names,
        plates=np.array([plate.corners[:, :2] for plate in trial.plates]),
    )
