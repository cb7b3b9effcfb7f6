"""Which frames are fully measured: every foot that may touch the ground stands on a force plate.

A foot MAY touch where one point of its sole is low over a surface and slow. Surfaces are the plates, the floor, and
every height at which a foot rested elsewhere in this trial (stairs, boxes). All rules err towards touching. A frame is
measured if every foot that may touch lies over plates with its whole sole; over a plate that is higher than everything
around it, what sticks out hangs in the air.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import savgol_filter

from biodance.errors import BiodanceError, TrialRefused
from biodance.lab.markers.sets import read_marker_set
from biodance.motion.dynamics import distribute
from biodance.motion.soles import (
    Footing,
    Soles,
    Surfaces,
    cop_outside,
    find_surfaces,
    footing,
    inside,
    overhang_notes,
    sitting,
    standing_on,
)
from biodance.records import SIDES, Array, LeftOut, LeftOutSpan, Mask, Plate, Trial, Wrench, runs
from biodance.settings import ContactRules

_FALLS = 0.6
"""Downward acceleration, in g, from which the markers fall freely. Whatever carries somebody makes the fall slower; the
swing of the limbs leaves 0.95 to 1.1 for the mean of markers all over the body, 0.97 to 1.45 for those of the pelvis
(legs that swing up push it down), which runners marked on the legs alone need: the mean of their markers is the legs'.
"""
_LACKS, _ENDS = 0.15, 0.05
"""Share of the weight that the plates lack while something else carries, and under which it has ended. In clean squats
and walks they lack less for more than half of `_LASTING`."""
_LASTING = 0.4  # s, at least, that something else carries: delays and impacts are over sooner
_PLAIN = 1.0
"""s of other times that must agree: a trunk goes otherwise than the whole body for as long as one bend lasts."""
_RIGHT = 0.1
"""Share of the weight, RMS, within which plates and movement agree at all other times. A late clock, a wrong gain or
mass is wrong then, too: what carries only at times takes away only at times."""
_SMOOTH = 0.3
"""s of the parabola whose curvature is the acceleration: 1 mm of noise in the mean of the markers is 0.02 g."""


def flight(trial: Trial, touching: Mask, load: Mask) -> Mask:
    """Return (T,) where the person flies: no plate is loaded and the markers fall freely, for as long as no foot may
    touch, or for as long as no plate is loaded (the foot that has just left a belt is low and slow).

    ``touching`` (T, 2), ``load`` (T, P). The plates then measure all that the ground does: nothing.
    """
    found = np.zeros(len(touching), dtype=bool)
    unloaded = np.logical_not(load.any(axis=1))
    for free in (unloaded, unloaded & np.logical_not(touching.any(axis=1))):
        for start, stop in runs(free):
            if not found[start] and falls_freely(trial, start, stop):
                found[start:stop] = True
    return found


def falls_freely(trial: Trial, start: int, stop: int) -> bool:
    """Return whether markers of body or pelvis fall freely in frames ``start`` to ``stop``: a parabola of one g.

    Who sits with both feet up does not, nor who hangs.
    """
    if trial.markers is None or trial.markers.time.size < 2:
        return False
    span = slice(max(0, start - 1), min(trial.markers.time.size, stop + 1))
    time, height = trial.markers.time[span], trial.markers.xyz[span, :, 2]
    whole = np.isfinite(height).all(axis=0)
    # 0.05 s: in less the parabola of the markers cannot be seen
    if time[-1] - time[0] < 0.05 or time.size < 4:
        return False
    for some in (whole, whole & _on(trial, "pelvis")):
        if some.any():
            mean, middle = height[:, some].mean(axis=1), time - time.mean()
            # z = c t² + ..: acceleration 2 c, downwards positive below.
            curve = np.polyfit(middle, mean, 2)
            # 0.005 m, RMS, by which the mean of the markers may leave the parabola (limbs move)
            straight = np.sqrt(np.mean((np.polyval(curve, middle) - mean) ** 2)) < 0.005
            if straight and -2 * curve[0] >= _FALLS * trial.settings.gravity:
                return True
    return False


def carried_elsewhere(trial: Trial, *, weight: float) -> Mask:
    """Return (T,) where something beside the plates carries a good part of the ``weight`` (N; NaN = unknown, then
    nowhere): a chair, a rail.

    By Newton the ground carries weight (1 + a / g), with a the vertical acceleration of pelvis and trunk. Where the
    plates lack a good part of it for a while, and nothing of it at all other times, something else carries.
    """
    lacks = share_lacking(trial, weight=weight)
    found = np.zeros(lacks.size, dtype=bool)
    if not lacks.any() or trial.markers is None:
        return found
    step = float(np.median(np.diff(trial.markers.time)))
    # Half the parabola's width, so that mean and curvature see about the same instants.
    smooth = uniform_filter1d(lacks, max(1, round(_SMOOTH / step / 2)))
    long = [(start, stop) for start, stop in runs(smooth > _LACKS) if stop - start >= _LASTING / step]
    for first, last in runs(lacks > _ENDS):
        found[first:last] = any(first < stop and start < last for start, stop in long)
    rest = smooth[~found]
    return found & (rest.size >= _PLAIN / step and float(np.sqrt(np.mean(rest**2))) < _RIGHT)


def share_lacking(trial: Trial, *, weight: float) -> Array:
    """Return (T,) which share of the ``weight`` N the plates lack of what pelvis and trunk (else all markers) need to
    move as they do; zero where nothing tells it: no markers or weight, forces that are unknown, half a parabola from an
    end of the recording.
    """
    total, markers = trial.wrench.force[:, 2], trial.markers
    if markers is None or not weight > 0 or markers.time.size != total.size or total.size < 2:
        return np.zeros(total.size)
    step = float(np.median(np.diff(markers.time)))
    frames = 2 * max(2, round(_SMOOTH / step / 2)) + 1
    whole: Mask = np.asarray(np.isfinite(markers.xyz).all(axis=(0, 2)))
    trunk = whole & _on(trial, "pelvis", "trunk_head")
    if not whole.any() or total.size < frames:
        return np.zeros(total.size)
    height = markers.xyz[:, trunk if trunk.any() else whole, 2].mean(axis=1)
    # By Newton F / (m g) = 1 + a / g; the second derivative of a parabola through `frames` samples.
    needed = 1 + savgol_filter(height, frames, 2, deriv=2, delta=step) / trial.settings.gravity
    lacks = np.nan_to_num(needed - total / weight)
    lacks[: frames // 2] = lacks[-(frames // 2) :] = 0.0
    return lacks


def _on(trial: Trial, *segments: str) -> Mask:
    """Return (K,) which markers of a trial sit on ``segments``, as far as its set tells."""
    own = read_marker_set(trial.marker_set).markers if trial.marker_set else ()
    names = () if trial.markers is None else trial.markers.names
    return np.isin(names, [one.label for one in own if one.segment in segments])


_EXPLAINED = 0.5
"""Share of its frames from which on feet beside the plates are all that the plates lack."""


class _Unmeasured(NamedTuple):
    """The ``frames`` (T,) that are not fully measured for one ``reason``, which ``text`` says of one foot or plate."""

    reason: LeftOut
    text: str
    frames: Mask


def _unmeasured_frames(
    trial: Trial, place: Footing, feet_down: "_FeetOnGround", borne: Mask
) -> tuple[_Unmeasured, ...]:
    """Return every reason why frames of a prepared trial are not fully measured; ``borne`` (T, P) the plates that feet
    must have loaded.
    """
    touching, rests, load = feet_down.touching, feet_down.rests, feet_down.load
    unloaded = ~load.any(axis=1) & ~flight(trial, touching, load)
    unknown: Mask = np.logical_not(np.isfinite(trial.wrench.value).all(axis=1))
    feet = tuple(one for foot in range(len(SIDES)) for one in _of_foot(place, touching, foot))
    elsewhere = carried_elsewhere(trial, weight=feet_down.weight)
    beside = np.any([one.frames for one in feet], axis=0)
    for start, stop in runs(elsewhere):
        elsewhere[start:stop] &= beside[start:stop].mean() < _EXPLAINED
    lacks = "the plates carry too little for this movement: a chair or a hand carries the rest"
    return (
        _Unmeasured(LeftOut.NO_LOAD, "no plate is loaded", unloaded & ~elsewhere),
        _Unmeasured(LeftOut.FORCE_UNKNOWN, "a plate's force is unknown", unknown),
        *feet,
        *(one for index in range(len(trial.plates)) for one in _of_plate(trial, place, rests, borne, index)),
        _Unmeasured(LeftOut.CARRIED_ELSEWHERE, lacks, elsewhere),
    )


def _of_foot(place: Footing, touching: Mask, foot: int) -> tuple[_Unmeasured, ...]:
    hidden, share, side = place.unseen[:, foot], place.share[:, foot], SIDES[foot]
    apart, off = touching[:, foot] & ~place.covered[:, foot] & ~hidden, f"the {side} foot may"
    return (
        _Unmeasured(LeftOut.FOOT_UNSEEN, f"the {side} foot was not seen", hidden),
        _Unmeasured(LeftOut.FOOT_BESIDE, f"{off} touch the ground beside the plates", apart & (share == 0)),
        _Unmeasured(LeftOut.FOOT_BESIDE, f"{off} stand partly on a plate, partly beside it", apart & (share > 0)),
    )


def _unread(place: Footing, rests: Mask, load: Mask, index: int) -> Mask:
    """Return (T, 2) where a foot rests on one plate alone, which reads no load."""
    return place.on_plate[:, :, index] & (place.on_plate.sum(axis=2) == 1) & rests & ~load[:, index, None]


def _of_plate(trial: Trial, place: Footing, rests: Mask, load: Mask, index: int) -> tuple[_Unmeasured, ...]:
    name, on, loaded = trial.plates[index].name, place.on_plate[:, :, index], load[:, index]
    alone = _unread(place, rests, load, index)
    return (
        _Unmeasured(LeftOut.NO_FOOT_ON_PLATE, f"{name} is loaded but no foot is over it", loaded & ~on.any(axis=1)),
        *(
            _Unmeasured(LeftOut.SILENT_PLATE, f"the {side} foot rests on {name}, which reads nothing", alone[:, foot])
            for foot, side in enumerate(SIDES)
        ),
    )


_SLOWEST = 0.2
"""m/s: a slower belt is none; feet creep that much in standing and at the edges of stance."""
_MOST = 0.6
_FEWEST = 10  # Frames of flat soles that tell a belt


def belts(trial: Trial, soles: Soles, load: Mask) -> tuple[Array, tuple[str, ...]]:
    """Return the velocity (P, 3) m/s of what the feet stand on, per plate, and a sentence for each belt; zero where it
    does not move.

    ``load`` (T, P) True where a plate is loaded. A belt is what nearly all flat, low soles on a loaded plate move with;
    its speed is taken as constant.
    """
    found, notes = np.zeros((len(trial.plates), 3)), []
    if soles.time.size < _FEWEST:
        return found, ()
    velocity, on = np.gradient(soles.outline, soles.time, axis=0), standing_on(trial.plates, soles)
    # Largest deviation of a sole's points from their mean velocity: small where it neither rolls nor turns.
    spread = np.linalg.norm(velocity - velocity.mean(axis=2, keepdims=True), axis=-1).max(axis=2)
    height = soles.outline[..., 2].mean(axis=2)
    # Height over the lowest in which this foot was ever seen: the floor need not be known.
    # 0.25 m/s: a sole whose points move more evenly than this lies flat on something
    # 0.03 m over its lowest height in which a sole stands
    flat = (spread < 0.25) & (height < np.nanmin(height, axis=0, initial=np.inf) + 0.03)
    for index, plate in enumerate(trial.plates):
        here = flat & on[:, :, index] & load[:, index, None]
        moving = velocity.mean(axis=2)[here]
        if len(moving) < _FEWEST:
            continue
        middle = np.median(moving, axis=0)
        # 0.15 m/s around the median in which most flat soles move on a belt of constant speed
        same = np.linalg.norm(moving - middle, axis=1) < 0.15
        if np.linalg.norm(middle) > _SLOWEST and same.mean() >= _MOST:
            found[index] = moving[same].mean(axis=0)
            notes.append(
                f"The soles on {plate.name} move with it at {np.linalg.norm(found[index]):.2f} m/s: a belt; contact is "
                f"judged by the speed relative to it."
            )
    return found, tuple(notes)


def speeds(soles: Soles, plates: tuple[Plate, ...] = (), moving: Array | None = None) -> Array:
    """Return the speed (T, 2, P) m/s of every point of the soles on what is under the sole; 0 for a single frame, NaN
    beside unseen ones.

    ``moving`` (plates, 3) m/s of the plates' belts. A sole that is over a part of a plate moves with its belt. Where
    rectangles of several plates are under it (drawn round pressures they overlap), it can stand on one of them only:
    each point's speed is the smallest that one of their belts leaves it.
    """
    if soles.time.size < 2:
        return 0.0 * soles.outline[..., 0]
    velocity = np.gradient(soles.outline, soles.time, axis=0)
    speed = np.linalg.norm(velocity, axis=-1)
    if moving is None or not moving.any():
        return speed
    least = np.full(speed.shape, np.inf)
    for plate, belt in zip(plates, moving, strict=True):
        over = (inside(plate, soles.outline) >= 0).any(axis=2, keepdims=True)
        least = np.where(over, np.minimum(least, np.linalg.norm(velocity - belt, axis=-1)), least)
    return np.where(np.isfinite(least), least, speed)


def _resting(speed: Array, time: Array, *, still: float, lasting: float) -> Mask:
    """Return (T, 2) where a foot rests: all its points slower than ``still`` m/s for ``lasting`` s."""
    slow = np.asarray((speed < still).all(axis=2))
    least = 1 if time.size < 2 else min(time.size, int(np.ceil(lasting / np.median(np.diff(time)))))
    found = np.zeros_like(slow)
    for foot in range(2):
        for start, stop in runs(slow[:, foot]):
            found[start:stop, foot] = stop - start >= least
    return found


def dilate(mask: Mask, frames: int) -> Mask:
    """Return ``mask`` (T, ...) widened by ``frames`` before and after every True."""
    return np.asarray(maximum_filter1d(mask, 2 * frames + 1, axis=0, mode="nearest")) if mask.size else mask


@dataclass(frozen=True, eq=False)
class Contact:
    """Ground contact of a trial; feet are ordered right, left, plates as in the trial.

    ``time`` (T,) s; ``touching`` (T, 2) True where a foot may touch anything; ``on_plate`` (T, 2, P) True where a part
    of a touching foot is over a plate; ``measured`` (T,) True where the plates measure all that the ground does;
    ``cop_outside`` (T, P) m, distance of a plate's centre of pressure from the soles on it (0 = inside), NaN = hardly
    loaded; ``notes`` how many frames remain, and why no others; ``told`` (T, 2) True where the plates tell what the
    ground does to this foot, whatever the other one stands on; ``left_out`` the frames (T,) that are not measured, by
    every reason that holds for them; ``seated`` (T,) True where the person sits on the plates (empty: nowhere);
    ``silent`` the plates that read no load under a resting foot, most of which is over them; ``half`` when a foot may
    stand partly beside a plate whose place the file does not tell.
    """

    time: Array
    touching: Mask
    on_plate: Mask
    measured: Mask
    cop_outside: Array
    notes: tuple[str, ...]
    told: Mask
    left_out: Mapping[LeftOut, Mask] = field(default_factory=dict)
    seated: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    silent: tuple[str, ...] = ()
    half: tuple[LeftOutSpan, ...] = ()


@dataclass(frozen=True, eq=False)
class _FeetOnGround:
    """The first half of a trial's contact: which plates (T, P) are in ``load`` and ``pressed``, which feet (T, 2)
    ``rests`` and are ``touching``, on what ``surfaces``; the sentences ``belted`` about belts; ``rules`` and ``weight``
    N of the body; where the person is ``seated`` (T,) on the plates.
    """

    load: Mask
    pressed: Mask
    rests: Mask
    touching: Mask
    surfaces: Surfaces
    belted: tuple[str, ...]
    rules: ContactRules
    weight: float
    seated: Mask


def ground_contact(trial: Trial, soles: Soles, *, mass: float = float("nan")) -> Contact:
    """Return the ground contact of a prepared trial: `feet_on_ground`, then `contact_with_plates`.

    Raises
    ------
    TrialRefused
        The trial has no force plate.
    BiodanceError
        Plates and soles have different times: the trial was not prepared.
    """
    return contact_with_plates(trial, soles, feet_on_ground(trial, soles, mass=mass))


def feet_on_ground(trial: Trial, soles: Soles, *, mass: float) -> _FeetOnGround:
    """Return what touches the ground in a prepared trial.

    ``mass`` kg of the body, NaN = unknown: a foot that rests away from all known heights while the plates carry at
    least nine tenths of the weight is held in the air; without the mass it counts as standing on something. The rules
    are those of ``trial.settings``.

    Raises
    ------
    TrialRefused
        The trial has no force plate.
    BiodanceError
        Plates and soles have different times: the trial was not prepared.
    """
    rules = trial.settings.contact
    if not trial.plates:
        raise TrialRefused(
            f"Trial {trial.name}: no force plate was recorded, so no frame is measured. Record with the plates on."
        )
    if any(
        plate.wrench.time.shape != soles.time.shape or not np.allclose(plate.wrench.time, soles.time)
        for plate in trial.plates
    ):
        raise BiodanceError(
            f"Trial {trial.name}: the plates and the feet have different times. Prepare the trial first."
        )
    force = np.stack([plate.wrench.force[:, 2] for plate in trial.plates], axis=1)
    largest = float(np.nanmax(force.sum(axis=1), initial=0.0))
    # Shares of the largest total force: the same rule for light and heavy persons.
    load, pressed = (force > max(rules.force, share * largest) for share in (rules.loaded, rules.pressed))
    moving, belted = belts(trial, soles, load)
    speed = speeds(soles, trial.plates, moving)
    weight = float(trial.settings.gravity * mass)
    seated = sitting(trial, soles, weight=weight)
    rests = _resting(speed, soles.time, still=rules.still, lasting=rules.lasting) & ~seated[:, None]
    surfaces = find_surfaces(trial, soles, rests, load, weight=weight)
    touching = _touching(soles, speed, surfaces, rules) & ~seated[:, None]
    return _FeetOnGround(load, pressed, rests, touching, surfaces, belted, rules, weight, seated)


def contact_with_plates(trial: Trial, soles: Soles, feet: _FeetOnGround) -> Contact:
    """Return the ground contact of a prepared trial whose ``feet`` are known."""
    touching, surfaces = feet.touching, feet.surfaces
    place = footing(trial.plates, soles, surfaces, touching, feet.load)
    borne = feet.load & ~feet.seated[:, None]
    found = _unmeasured_frames(trial, place, feet, borne)
    measured = ~np.any([one.frames for one in found], axis=0)
    left_out: dict[LeftOut, Mask] = {}
    for one in found:
        if one.frames.any():
            left_out[one.reason] = left_out.get(one.reason, False) | one.frames
    outside = cop_outside(trial.plates, soles, place, feet.pressed)
    hang = (
        f"The person sits on something that stands on the plates in {int(feet.seated.sum())} of {feet.seated.size} "
        f"frames: they carry the weight, and both feet hang."
    )
    unplaced = [plate.name for plate in trial.plates if not plate.placed]
    nowhere = (
        f"Where {', '.join(unplaced)} lie is not in the file: a foot is taken to stand on the plate whose centre of "
        f"pressure is under it, and one partly beside its plate is seen only by the weight that is lacking."
    )
    counts = Counter({one.text: int(one.frames.sum()) for one in found if one.frames.any()})
    first = f"{int(measured.sum())} of {measured.size} frames are fully measured by the plates."
    notes = (
        (first, *(f"Left out, {count} of {measured.size}: {text}." for text, count in counts.most_common()))
        + (hang,) * bool(feet.seated.any())
        + (nowhere,) * bool(unplaced)
        + feet.belted
        + surfaces.notes
        + overhang_notes(trial.plates, soles, feet.rests & touching & ~place.covered & (place.share > 0))
        + _cop_notes(trial, outside, measured, feet.rules)
    )
    told = measured[:, None] | _told(trial, place, touching, feet.rests, borne)
    silent = tuple(
        plate.name
        for index, plate in enumerate(trial.plates)
        if (_unread(place, feet.rests, borne, index) & ((inside(plate, soles.outline) >= 0).mean(axis=2) > 0.5)).any()
    )
    return Contact(soles.time, touching, place.on_plate, measured, outside, notes, told, left_out, feet.seated, silent)


def _told(trial: Trial, place: Footing, touching: Mask, rests: Mask, load: Mask) -> Mask:
    """Return (T, 2) where a foot is off the ground, or stands wholly over plates that the other foot is not on."""
    # Both feet over one plate: its wrench cannot be divided between them by measurement.
    shared = np.any(np.all(place.on_plate, axis=1), axis=1)
    silent = np.any(place.on_plate & rests[..., None] & ~load[:, None], axis=2)
    # A loaded plate under no foot: somebody or something else loads it, and no foot's wrench is certain.
    orphan = np.any(load & ~np.any(place.on_plate, axis=1), axis=1)
    known = np.all(np.isfinite(trial.wrench.value), axis=1) & ~shared & ~orphan
    return np.asarray(known[:, None] & ~place.unseen & (~touching | place.covered) & ~silent)


def _touching(soles: Soles, speed: Array, surfaces: Surfaces, rules: ContactRules) -> Mask:
    """Return (T, 2) where a foot may touch: low and slow, or not seen, widened in time."""
    height = soles.outline[..., 2] - surfaces.offset
    near = np.abs(height[..., None] - np.array(surfaces.levels)).min(axis=-1) < rules.height
    # Below all known levels counts as low: a step down that no level knows yet.
    low = near | (height < min(surfaces.levels))
    unseen = np.isnan(height).any(axis=2)
    found = (low & (speed < rules.speed)).any(axis=2)
    frames = 0 if soles.time.size < 2 else int(np.ceil(rules.around / np.median(np.diff(soles.time))))
    return dilate(found, frames) | unseen


def _cop_notes(trial: Trial, outside: Array, measured: Mask, rules: ContactRules) -> tuple[str, ...]:
    """Return a sentence for every plate whose centre of pressure lies outside the soles on it (median)."""
    notes = []
    for index, plate in enumerate(trial.plates):
        distance = outside[measured, index]
        distance = distance[~np.isnan(distance)]
        if distance.size and np.median(distance) > rules.outside:
            notes.append(
                f"{plate.name}: the centre of pressure lies {1000 * np.median(distance):.0f} mm outside the foot on "
                f"it (median). "
                "Check the plate's place and the signs of its channels."
            )
    return tuple(notes)


def foot_wrenches(trial: Trial, contact: Contact, soles: Soles) -> dict[str, Wrench]:
    """Return the measured wrenches on ``right_foot`` and ``left_foot``: each plate goes to the foot on it, or is
    distributed between both.

    Plates under no foot go to the foot that is nearer to their centre of pressure. The sum is the trial's total wrench;
    only where ``contact.measured`` is it all that acts on the feet. Feet of who sits on the plates bear nothing.
    """
    parts, standing = [], 1.0 - contact.seated[:, None] if contact.seated.size else 1.0
    for index, plate in enumerate(trial.plates):
        # The centres of the right and the left sole (T, 3) m, moved vertically to the plate's height.
        centre = soles.centre.copy()
        centre[..., 2] = plate.height
        parts.append(distribute(plate.wrench, centre[:, 0], centre[:, 1], contact.on_plate[:, :, index]))
    total = (standing * np.sum([part[foot].value for part in parts], axis=0) for foot in range(len(SIDES)))
    return {f"{side}_foot": Wrench(trial.wrench.time, value) for side, value in zip(SIDES, total, strict=True)}
