"""A trial cut into what repeats: events of the feet, gait cycles of each foot, squats, rises from a chair, jumps."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median_low
from typing import Literal

import numpy as np

from biodance.body.body import Body
from biodance.motion.contact import Contact
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.soles import Soles, soles_from_body
from biodance.records import SIDES, Array, FootEvent, LeftOutSpan, Mask, Motion, Plate, Wrench, contacts, runs
from biodance.settings import FORCE_DOWN

# Zeni et al. (2008, doi:10.1016/j.gaitpost.2007.07.007): a foot strikes where its heel is farthest ahead of the pelvis
# and leaves where its toes are farthest behind it. There the foot still moves with the pelvis, not with the ground; the
# strike is therefore taken where the heel has `_STRIKES`, the leaving where the toes still have `_LEAVES` of the
# ground's speed under the pelvis. A walker's toes leave forwards; a runner's leave upwards and go back as fast as the
# ground for 60 to 80 ms more, so that toes which have risen by `_OFF_GROUND` have left, too. Ahead is where the pelvis
# faces in that frame, so that turns and treadmills are walked, too. The body follows the markers, so that a marker that
# is lost for a moment costs no event.


def foot_events(feet: Mapping[str, Wrench], contact: Contact, plates: Sequence[Plate]) -> tuple[FootEvent, ...]:
    """Return when each foot came down on a plate or left it, in the order of time.

    ``feet`` the wrenches on the right and the left foot. An event is where the vertical force passes `FORCE_DOWN`,
    between two frames in which the plates tell what the ground does to this foot and the other one is not over the same
    plate: a force that two feet share tells nothing of one. Those forces are low-passed, which tells a sudden strike up
    to 34 ms early: where one of the ``plates`` under the foot passes it as recorded, too (`Plate.loaded`), that
    instant counts.
    """
    events, shared = [], under_both_feet(contact, plates)
    for foot, side in enumerate(SIDES):
        wrench = feet[f"{side}_foot"]
        sure, force = contact.told[:, foot] & ~shared, wrench.force[:, 2]
        loaded = contacts(wrench)
        for i in np.flatnonzero(loaded[1:] != loaded[:-1]) if loaded.size > 1 else ():
            if not (sure[i] and sure[i + 1]):
                continue
            # Straight line between the two frames; clipped, since shorter contacts were filled in.
            share = (FORCE_DOWN - force[i]) / (force[i + 1] - force[i])
            time = wrench.time[i] + np.clip(share, 0, 1) * (wrench.time[i + 1] - wrench.time[i])
            under = contact.on_plate[i, foot] | contact.on_plate[i + 1, foot]
            own = _recorded(float(time), [plate for plate, on in zip(plates, under, strict=True) if on], loaded[i + 1])
            time = own[np.argmin(np.abs(own - time))] if own.size else time
            events.append(FootEvent(float(time), side, bool(loaded[i + 1])))
    return tuple(sorted(events, key=lambda event: event.time))


def under_both_feet(contact: Contact, plates: Sequence[Plate]) -> Mask:
    """Return (T,) where both feet may be on one plate that carries something: between two steps of a runner it is
    empty.
    """
    found = np.zeros(contact.time.size, dtype=bool)
    for k, one in enumerate(plates):
        found |= contact.on_plate[..., k].all(axis=1) & contacts(one.wrench)
    return found


def _recorded(time: float, plates: Sequence[Plate], down: bool) -> Array:
    """Return the instants (n,) s near ``time`` at which the force on some ``plates``, as recorded, begins (``down``) or
    ends.
    """
    ends = np.concatenate([plate.loaded[:, 0 if down else 1] for plate in plates]) if plates else np.zeros(0)
    return np.asarray(ends[np.abs(ends - time) < _TOGETHER])


_SWING = 0.25
"""Of the leg's length: a foot that does not travel as far ahead of the other and back makes no step."""
_STRIKES, _LEAVES = 0.8, 0.6
"""Of the ground's speed under the pelvis. With them 57 strikes and 59 leavings of seven children, which their lab
set by hand and force, are met to -4 and 0 ms in the mean (sd 15, 16 ms); with Zeni's extremes to -34 and +20 ms.
Beside forces as recorded strikes lie -21 to +19 ms (median of each of six laboratories, walking and running), and no
other tenth lies nearer. Low-passed forces are no measure: a strike is so sudden that they tell it 7 to 34 ms early.
"""
_OFF_GROUND = 0.02
"""m over its lowest place in standing at which a sole has left the ground: toes press 1 to 2 cm into shoe and skin."""
_STOOD = 0.3  # s before toes are farthest behind, in which they stood: a runner's get there 0.15 s after leaving
_EVENT_CUTOFF = 8.0
"""Hz of the low-pass on the paths of the feet, of which only the extremes are looked for."""
_TOGETHER = 0.1  # s: events of force and of markers that are nearer than this are one event


def kinematic_events(body: Body, motion: Motion) -> tuple[FootEvent, ...]:
    """Return strikes and leavings of both feet by the tracked body, in the order of time; () where nobody steps.

    Raises
    ------
    TrialRefused
        The body has no two feet.
    """
    outline, pose = soles_from_body(body, motion).outline, poses(body, motion.q)
    forward = pose.rotation[:, 0, :2, 0]
    # Horizontal part of the pelvis' x axis.
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    places = heel_and_toe(body, outline)
    height = places[1][..., 2]  # m of the toes, (T, 2)
    # (place of the foot - place of the pelvis) · forward.
    ahead = (np.einsum("tfk,tk->tf", place[..., :2] - pose.position[:, :1, :2], forward) for place in places)
    heel, toe = ahead  # m ahead of the pelvis, (T, 2)
    least = _SWING * _thigh_and_shank(body)
    if motion.time.size < 0.5 * motion.rate or not np.ptp(heel[:, 0] - heel[:, 1]) > least:
        return ()
    events = []
    for foot, side in enumerate(SIDES):
        strikes = _turning_points(heel[:, foot], motion, least / 2)
        leavings = _turning_points(toe[:, foot], motion, least / 2, height[:, foot])
        events += [FootEvent(time, side, True, "markers") for time in strikes]
        events += [FootEvent(time, side, False, "markers") for time in leavings]
    return tuple(sorted(events, key=lambda event: event.time))


def that_may_touch(events: tuple[FootEvent, ...], contact: Contact | None) -> tuple[FootEvent, ...]:
    """Return the events without strikes of a foot that is in the air within `_TOGETHER` of them: who stands on one leg
    swings the other; all of them where no plate tells of contact.
    """

    def touches(one: FootEvent, contact: Contact) -> bool:
        near = np.abs(contact.time - one.time) < _TOGETHER
        return bool(contact.touching[near, SIDES.index(one.side)].any())

    return tuple(one for one in events if contact is None or not one.down or touches(one, contact))


def heel_and_toe(body: Body, outline: Array) -> tuple[Array, Array]:
    """Return the backmost and the foremost part (T, 2, 3) m of the soles (T, 2, P, 3) m, right foot first."""
    heel, toe = np.empty((2, len(outline), 2, 3))
    # Tenths of the length of the sole at either end.
    for foot, side in enumerate(SIDES):
        length = body.feet[side].outline[:, 0]
        reach = length.max() - length.min()
        heel[:, foot] = outline[:, foot, length < length.min() + 0.1 * reach].mean(axis=1)
        toe[:, foot] = outline[:, foot, length > length.max() - 0.1 * reach].mean(axis=1)
    return heel, toe


def agreement_of_events(force: tuple[FootEvent, ...], markers: tuple[FootEvent, ...]) -> tuple[Array, Array]:
    """Return by how much strikes and leavings (n,) s come later by markers than by forces, both seen."""
    late = [(event.down, delay_of_nearest(markers, event)) for event in force]
    strikes, leavings = ([s for d, s in late if d is down and abs(s) < _TOGETHER] for down in (True, False))
    return np.array(strikes), np.array(leavings)


def delay_of_nearest(events: Iterable[FootEvent], event: FootEvent) -> float:
    """Return by how many s the nearest of ``events`` of this kind and foot comes later; infinity without."""
    kind = event.side, event.down
    return min((one.time - event.time for one in events if (one.side, one.down) == kind), key=abs, default=np.inf)


def joined_events(force: tuple[FootEvent, ...], markers: tuple[FootEvent, ...]) -> tuple[FootEvent, ...]:
    """Return the events of both, in the order of time: the force's where a plate saw it, else the markers'."""
    kept = [event for event in markers if not abs(delay_of_nearest(force, event)) < _TOGETHER]
    return tuple(sorted((*force, *kept), key=lambda event: event.time))


def replaced_events(found: tuple[FootEvent, ...], said: tuple[FootEvent, ...]) -> tuple[FootEvent, ...]:
    """Return the events that were ``found``, with those that were ``said`` by hand in the place of all of their side,
    in the order of time.
    """
    sides = {one.side for one in said}
    kept = (one for one in found if one.side not in sides)
    return tuple(sorted((*kept, *said), key=lambda event: event.time))


def _thigh_and_shank(body: Body) -> float:
    """Return the length, m, of thigh and shank together, mean of both legs."""
    ends = ("knee_flexion", "ankle_dorsiflexion")
    # Both legs are summed: half of it is the mean.
    return float(sum(np.linalg.norm(one.translation) for one in body.joints if one.name.endswith(ends))) / 2


def _turning_points(path: Array, motion: Motion, prominence: float, height: Array | None = None) -> list[float]:
    """Return the times s at which a heel by its ``path`` (T,) m begins to go with the ground, or, where their
    ``height`` (T,) m is given, toes end to do so or rise off it.
    """
    from scipy.signal import butter, find_peaks, sosfiltfilt

    rate, toes = motion.rate, height is not None
    if rate > 2.5 * _EVENT_CUTOFF:
        # Forwards and backwards: no delay.
        path = sosfiltfilt(butter(2, _EVENT_CUTOFF, fs=rate, output="sos"), path, padlen=min(20, path.size - 1))
    speed = np.gradient(path, motion.time)
    # A foot on the ground goes backwards under the pelvis: the median of the negative speeds.
    ground = float(np.median(speed[speed < 0]))
    # A strike is a top of the heel's path, a leaving the lowest point of the toes'.
    # 0.5 s between two strikes of one foot, at least
    tops, _ = find_peaks(-path if toes else path, prominence=prominence, distance=max(1, round(0.5 * rate)))
    # From the strike on in time, from the leaving back: to where the foot has the ground's speed.
    step, level = (-1, _LEAVES) if toes else (1, _STRIKES)
    slow = level - speed / ground  # Share of the ground's speed that the foot lacks: it goes with the ground below 0
    times = []
    for top in tops[motion.determined[tops]]:
        lacks = slow
        if height is not None:
            low = height[max(0, top - round(_STOOD * rate)) : top + 1].min()
            # In the air as long as either says so: in units of the height at which it has left the ground.
            lacks = np.maximum(slow, (height - low) / _OFF_GROUND - 1.0)
        here = int(top)
        while 0 < here < path.size - 1 and lacks[here] > 0:
            here += step
        before = here - step
        # Where it passes 0, linearly between two frames.
        share = lacks[before] / (lacks[before] - lacks[here]) if lacks[here] <= 0 else 1.0
        times.append(float(motion.time[before] + step * share / rate))
    return times


_CycleKind = Literal["gait", "squat", "sit_to_stand", "jump"]
PERCENT = np.linspace(0.0, 100.0, 101)
"""% of a cycle at which its curves are given."""
_SHORTEST_STRIDE, _LONGEST_STRIDE = 0.4, 4.0
"""s of a gait cycle. After a stroke who walks at home alone is slower than 0.4 m/s (Perry et al. 1995,
doi:10.1161/01.STR.26.6.982): with steps of 0.3 m a cycle takes 1.5 s there, and 3 s at half that speed.
"""
_STOOD = 2.0
"""Times the middle cycle of its trial from which somebody has stood between two steps."""
_DEEP = 0.15  # Of the leg's length by which the pelvis goes down in a squat, at least
_UP = 0.1  # Of a repetition's depth within which the pelvis counts as up, or a countermovement has not begun
_SEATED = 0.03
"""m that the centre of mass lies behind the heels of somebody who sits: standing so, one falls."""


@dataclass(frozen=True)
class Cycle:
    """One repetition in ``trial``: ``kind``; ``side`` of the foot whose gait cycle it is, "both" for all others;
    ``start``, ``end`` s on the clock of the trial; ``off`` s when the foot leaves the ground (gait, jump), when the
    seat is left (rise) or when the pelvis is lowest (squat); NaN = not known.
    """

    trial: str
    kind: _CycleKind
    side: str
    start: float
    end: float
    off: float

    @property
    def duration(self) -> float:
        """Its length, s."""
        return self.end - self.start

    @property
    def off_percent(self) -> float:
        """``off`` in % of the cycle: of a gait cycle the stance."""
        return 100 * (self.off - self.start) / self.duration

    def overlaps(self, other: "Cycle") -> bool:
        """Return whether two repetitions share time: then nobody stood between them. Each overlaps itself."""
        return self.start < other.end and other.start < self.end

    def near(self, jump: "Cycle") -> bool:
        """Return whether it is a part of a ``jump``, or of its landing, which goes down like a squat."""
        # 0.3 s after a landing in which the way down of its absorption begins
        return self.start < jump.end + 0.3 and jump.start < self.end

    def times(self) -> Array:
        """Return the times (101,) s of `PERCENT`."""
        return self.start + PERCENT / 100 * self.duration

    def frames(self, time: Array) -> slice:
        """Return those of the frames at ``time`` (T,) s that its curves hang on: one more on either side."""
        # searchsorted on the right gives the first frame after: one before it, one after the end.
        first, last = np.searchsorted(time, (self.start, self.end), side="right")
        return slice(max(int(first) - 1, 0), int(last) + 1)


_TOUCHES = 0.02
"""s by which a cycle may reach into a span that is left out: its ends are events, known to some frames."""


def is_left_out(cycle: Cycle, spans: Iterable[LeftOutSpan]) -> bool:
    """Return whether a cycle reaches into one of the ``spans`` of its side, or of both sides."""
    mine = (one for one in spans if one.side in ("", cycle.side))
    return any(min(one.end, cycle.end) - max(one.start, cycle.start) > _TOUCHES for one in mine)


def gait_cycles(trial: str, events: tuple[FootEvent, ...]) -> tuple[Cycle, ...]:
    """Return the cycles from each strike to the next of the same foot, with the other foot's strike between them, but
    those in which somebody stood (`_STOOD`).
    """
    cycles = []
    for side in SIDES:
        strikes = [e.time for e in events if e.down and e.side == side]
        others = [e.time for e in events if e.down and e.side != side]
        for start, end in pairwise(strikes):
            if not _SHORTEST_STRIDE < end - start < _LONGEST_STRIDE or not any(start < one < end for one in others):
                continue
            offs = [e for e in events if not e.down and e.side == side and start < e.time < end]
            seen = [e for e in offs if e.source == "force"] or offs  # what a plate saw is no guess
            cycles.append(Cycle(trial, "gait", side, start, end, seen[0].time if len(seen) == 1 else float("nan")))
    return _walked(sorted(cycles, key=lambda cycle: cycle.start))


def _walked(cycles: Sequence[Cycle]) -> tuple[Cycle, ...]:
    """Return the cycles in which nobody stood."""
    longest = _STOOD * median_low(one.duration for one in cycles) if cycles else 0.0
    return tuple(one for one in cycles if one.duration < longest)


def repetitions(trial: str, body: Body, motion: Motion, soles: Soles) -> tuple[Cycle, ...]:
    """Return the squats and the rises from a chair of a trial in which the feet stay where they are.

    A squat begins and ends standing and goes down by `_DEEP` of the leg's length at least. Whoever has the centre of
    mass `_SEATED` behind the heels sits on something: a rise begins with the centre of mass moving and ends standing.
    """
    height, time = poses(body, motion.q).position[:, 0, 2], motion.time
    # Percentile: a jump of a marker is no height.
    top, centre = float(np.percentile(height, 98)), centre_of_mass(body, motion)
    heel, toe = (place[..., :2] for place in heel_and_toe(body, soles.outline))
    ahead = (toe - heel).mean(axis=1)
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    # The smaller of both feet: the centre of mass of who sits lies behind both heels, as the feet point.
    seated = np.einsum("tfk,tk->tf", heel - centre[:, None, :2], ahead).min(axis=1) > _SEATED
    cycles: list[Cycle] = []
    for first, stop in runs(height < top - _DEEP * _thigh_and_shank(body)):
        lowest = first + int(np.argmin(height[first:stop]))
        # Within `_UP` of the depth from the top: before and after this dip.
        up = np.flatnonzero(height >= top - _UP * (top - height[lowest]))
        before, after = up[up < first], up[up >= stop]
        if not after.size or not motion.determined[first : after[0] + 1].all():
            continue
        path = soles.centre[first : after[0] + 1, :, :2]
        # 0.1 m that a foot may travel in a squat or a rise
        if np.linalg.norm(path - path[0], axis=-1).max() > 0.1:
            continue
        if seated[first:stop].any():
            leaves = first + int(np.flatnonzero(seated[first:stop])[-1])
            speed = np.linalg.norm(np.gradient(centre, motion.time, axis=0), axis=1)
            # 0.05 m/s of the centre of mass from which a rise has begun
            rest = np.flatnonzero(speed[: leaves + 1] < 0.05)
            instants = time[[int(rest[-1]) if rest.size else 0, after[0], leaves]]
            cycles.append(Cycle(trial, "sit_to_stand", "both", *instants.tolist()))
        elif before.size:
            cycles.append(Cycle(trial, "squat", "both", *time[[before[-1], after[0], lowest]].tolist()))
    # Each overlaps itself: one that overlaps another has no standing between.
    return tuple(one for one in cycles if sum(map(one.overlaps, cycles)) == 1)


_RISES = 0.05
"""m that the centre of mass comes down again on either side of the highest point of a jump, at least."""
_CLEAR = 0.04
"""m over its lowest place before and after at which a sole is in the air at the highest point of a jump."""
_NEAR = 0.6
"""s before and after the highest point in which the feet stand: half the flight of a jump of 0.45 m, and a contact."""
_BOTH_LEAVE = 0.12
"""s within which both feet leave the ground: who runs has one in the air long before."""


def jumps(
    trial: str,
    motion: Motion,
    soles: Soles,
    centre: Array,
    feet: Mapping[str, Wrench] | None,
    known: Mask,
    plates: Sequence[Plate],
) -> tuple[Cycle, ...]:
    """Return the jumps of a trial; ``centre`` (T, 3) m of mass.

    A jump leaves the ground with both feet and comes down as high as it left. It begins where the centre of mass starts
    to go down before it, or, after a flight (a drop, another jump), with that landing; ``off`` is the take-off;
    it ends with the landing. Both are where the force of both ``feet`` passes `FORCE_DOWN` in frames in which it is
    ``known`` (T, 2), as recorded on all ``plates`` (`Plate.loaded`), else where the soles are `_OFF_GROUND` over the
    ground.
    """
    from scipy.signal import find_peaks

    height, time = centre[:, 2], motion.time
    sole, near = soles.outline[..., 2].min(axis=2), max(1, round(_NEAR * motion.rate))
    # `_RISES` on either side of a top.
    tops, _ = find_peaks(height, prominence=_RISES)
    flights = [flight for top in tops if (flight := _flight(sole, int(top), near, motion.determined)) is not None]
    # 0.1 s in the air: less is a hop in a march
    found = [_cycle(trial, time, height, one) for one in flights if time[one[2]] - time[one[1]] >= 0.1]
    if feet is None:
        return tuple(found)
    total = feet["right_foot"].force[:, 2] + feet["left_foot"].force[:, 2]
    return tuple(_by_force(one, time, total, np.asarray(known.all(axis=1)), plates) for one in found)


def _flight(sole: Array, top: int, near: int, determined: Mask) -> tuple[int, int, int] | None:
    """Return where the contact before a highest point begins, its last frame, and the first one on the ground again;
    None where both feet do not fly.

    ``sole`` (T, 2) m height of the lowest part of each.
    """
    before, after = sole[max(0, top - near) : top + 1], sole[top : top + near]
    ground = np.stack([before.min(axis=0), after.min(axis=0)])
    # Both soles are clear of the ground, and it is as high before as after.
    if not (sole[top] > ground + _CLEAR).all() or np.abs(ground[1] - ground[0]).max() > _CLEAR:
        return None
    # Backwards from the top: the last frame in which each foot is at the ground.
    left = [top - int(np.argmax((before[:, foot] < ground[0, foot] + _OFF_GROUND)[::-1])) for foot in (0, 1)]
    down = [top + int(np.argmax(after[:, foot] < ground[1, foot] + _OFF_GROUND)) for foot in (0, 1)]
    first, last = max(left), min(down)
    # `near` frames are `_NEAR` s: `_BOTH_LEAVE` s in frames.
    if not determined[first : last + 1].all() or first - min(left) > near * _BOTH_LEAVE / _NEAR:
        return None
    # Since when at least one foot has been on the ground: a flight before it is another one.
    above = np.flatnonzero((sole[:first] > ground[0] + _OFF_GROUND).all(axis=1))
    return (int(above[-1]) + 1 if above.size else 0), first, last


def _cycle(trial: str, time: Array, height: Array, flight: tuple[int, int, int]) -> Cycle:
    """Return the jump with a ``flight`` (`_flight`)."""
    landed, off, down = flight
    # From the last sinking frame before take-off: all after it is the push.
    sinks = np.flatnonzero(np.diff(height[landed : off + 1]) < 0)
    lowest = landed + (int(sinks[-1]) + 1 if sinks.size else 0)  # where the last rise before the take-off begins
    way = height[landed : lowest + 1].max() - height[lowest]
    # The last frame that is within `_UP` of the way down from its top.
    high = np.flatnonzero(height[landed : lowest + 1] >= height[lowest] + (1 - _UP) * way)
    return Cycle(trial, "jump", "both", float(time[landed + high[-1]]), float(time[down]), float(time[off]))


def _by_force(cycle: Cycle, time: Array, total: Array, sure: Mask, plates: Sequence[Plate]) -> Cycle:
    """Return a jump with take-off and landing where the force tells them."""
    ends = {}
    for name, at, falls in (("off", cycle.off, True), ("end", cycle.end, False)):
        near = np.flatnonzero(np.abs(time[:-1] - at) < _BOTH_LEAVE)
        down = total > FORCE_DOWN
        passes = [i for i in near if sure[i] and sure[i + 1] and down[i] == falls and down[i + 1] != falls]
        if passes:
            i = min(passes, key=lambda k: abs(time[k] - at))
            share = (FORCE_DOWN - total[i]) / (total[i + 1] - total[i])
            passed = float(time[i] + share * (time[i + 1] - time[i]))
            own = _recorded(passed, plates, down=not falls)
            # In the air from when the last plate is left to when the first one is met.
            ends[name] = float(own.max() if falls else own.min()) if own.size else passed
    off, end = ends.get("off", cycle.off), ends.get("end", cycle.end)
    return Cycle(cycle.trial, cycle.kind, cycle.side, cycle.start, end, off)
