"""Which frames are fully measured: every foot that may touch the ground stands on a force plate.

A foot MAY touch where one point of its sole is low over a surface and slow. Surfaces are the plates, the floor, and
every height at which a foot rested elsewhere in this trial (stairs, boxes). All rules err towards touching. A frame is
measured if every foot that may touch lies over plates with its whole sole; over a plate that is higher than everything
around it, what sticks out hangs in the air.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.contact.belts import belts, dilate, resting, speeds
from biodance.motion.contact.footing import Footing, cop_outside, footing, overhang_notes
from biodance.motion.contact.soles import Soles
from biodance.motion.contact.surfaces import Surfaces, find_surfaces
from biodance.motion.contact.unmeasured import by_reason, unmeasured_frames, unmeasured_notes
from biodance.motion.dynamics import distribute
from biodance.records import SIDES, Array, LeftOut, Mask, Trial, Wrench
from biodance.settings import ContactRules


@dataclass(frozen=True, eq=False)
class Contact:
    """Ground contact of a trial; feet are ordered right, left, plates as in the trial.

    ``time`` (T,) s; ``touching`` (T, 2) True where a foot may touch anything; ``on_plate`` (T, 2, P) True where a part
    of a touching foot is over a plate; ``measured`` (T,) True where the plates measure all that the ground does;
    ``cop_outside`` (T, P) m, distance of a plate's centre of pressure from the soles on it (0 = inside), NaN = hardly
    loaded; ``notes`` how many frames remain, and why no others; ``told`` (T, 2) True where the plates tell what the
    ground does to this foot, whatever the other one stands on; ``left_out`` the frames (T,) that are not measured, by
    every reason that holds for them.
    """

    time: Array
    touching: Mask
    on_plate: Mask
    measured: Mask
    cop_outside: Array
    notes: tuple[str, ...]
    told: Mask
    left_out: Mapping[LeftOut, Mask] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FeetOnGround:
    """The first half of a trial's contact: which plates (T, P) are in ``load`` and ``pressed``, which feet (T, 2)
    ``rests`` and are ``touching``, on what ``surfaces``; the sentences ``belted`` about belts; ``rules`` and ``weight``
    N of the body.
    """

    load: Mask
    pressed: Mask
    rests: Mask
    touching: Mask
    surfaces: Surfaces
    belted: tuple[str, ...]
    rules: ContactRules
    weight: float


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


def feet_on_ground(trial: Trial, soles: Soles, *, mass: float = float("nan")) -> FeetOnGround:
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
    load, pressed = (force > max(rules.force, share * largest) for share in (rules.loaded, rules.pressed))
    moving, belted = belts(trial, soles, load)
    speed = speeds(soles, trial.plates, moving)
    rests = resting(speed, soles.time, still=rules.still, lasting=rules.lasting)
    weight = float(trial.settings.gravity * mass)
    surfaces = find_surfaces(trial, soles, rests, load, weight=weight)
    touching = _touching(soles, speed, surfaces, rules)
    return FeetOnGround(load, pressed, rests, touching, surfaces, belted, rules, weight)


def contact_with_plates(trial: Trial, soles: Soles, feet: FeetOnGround) -> Contact:
    """Return the ground contact of a prepared trial whose ``feet`` are known."""
    touching, surfaces = feet.touching, feet.surfaces
    place = footing(trial.plates, soles, surfaces, touching, feet.load)
    found = unmeasured_frames(trial, place, touching, feet.rests, feet.load, weight=feet.weight)
    measured = ~np.any([one.frames for one in found], axis=0)
    outside = cop_outside(trial.plates, soles, place, feet.pressed)
    notes = (
        unmeasured_notes(measured, found)
        + _unplaced(trial)
        + feet.belted
        + surfaces.notes
        + overhang_notes(trial.plates, soles, feet.rests & touching & ~place.covered & (place.share > 0))
        + _cop_notes(trial, outside, measured, feet.rules)
    )
    told = measured[:, None] | _told(trial, place, touching, feet.rests, feet.load)
    return Contact(soles.time, touching, place.on_plate, measured, outside, notes, told, by_reason(found))


def _told(trial: Trial, place: Footing, touching: Mask, rests: Mask, load: Mask) -> Mask:
    """Return (T, 2) where a foot is off the ground, or stands wholly over plates that the other foot is not on."""
    shared = np.any(np.all(place.on_plate, axis=1), axis=1)
    silent = np.any(place.on_plate & rests[..., None] & ~load[:, None], axis=2)
    orphan = np.any(load & ~np.any(place.on_plate, axis=1), axis=1)
    known = np.all(np.isfinite(trial.wrench.value), axis=1) & ~shared & ~orphan
    return np.asarray(known[:, None] & ~place.unseen & (~touching | place.covered) & ~silent)


def _touching(soles: Soles, speed: Array, surfaces: Surfaces, rules: ContactRules) -> Mask:
    """Return (T, 2) where a foot may touch: low and slow, or not seen, widened in time."""
    height = soles.outline[..., 2] - surfaces.offset
    near = np.abs(height[..., None] - np.array(surfaces.levels)).min(axis=-1) < rules.height
    low = near | (height < min(surfaces.levels))
    unseen = np.isnan(height).any(axis=2)
    found = (low & (speed < rules.speed)).any(axis=2)
    frames = 0 if soles.time.size < 2 else int(np.ceil(rules.around / np.median(np.diff(soles.time))))
    return dilate(found, frames) | unseen


def _unplaced(trial: Trial) -> tuple[str, ...]:
    """Say what cannot be known of plates whose place the file does not tell."""
    names = [plate.name for plate in trial.plates if not plate.placed]
    if not names:
        return ()
    return (
        f"Where {', '.join(names)} lie is not in the file: a foot is taken to stand on the plate whose centre of "
        f"pressure is under it, and a foot partly beside its plate cannot be seen.",
    )


def _cop_notes(trial: Trial, outside: Array, measured: Mask, rules: ContactRules) -> tuple[str, ...]:
    """Return a sentence for every plate whose centre of pressure lies outside the soles on it, as a median over the
    measured frames.
    """
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
    only where ``contact.measured`` is it all that acts on the feet.
    """
    parts = []
    for index, plate in enumerate(trial.plates):
        parts.append(distribute(plate.wrench, *_on_ground(soles, plate.height), contact.on_plate[:, :, index]))
    total = (np.sum([part[foot].value for part in parts], axis=0) for foot in range(len(SIDES)))
    return {f"{side}_foot": Wrench(trial.wrench.time, value) for side, value in zip(SIDES, total, strict=True)}


def _on_ground(soles: Soles, height: float) -> tuple[Array, Array]:
    """Return the centres of the right and the left sole (T, 3) m, moved vertically to the plate's height."""
    centre = soles.centre.copy()
    centre[..., 2] = height
    return centre[:, 0], centre[:, 1]
