"""The cue sheet: a dance in plain words, posture by posture, for the person who calls it and the person who performs
it.

Only what moves is said, largest first, pairs together (right and left; trunk and hips that go the same way), angles
rounded to what a person can follow; what goes beyond ``MOST`` things is said after them, so that nothing is left out.
"""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.stance import Stance
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array

_SMALLEST = 12.0  # degrees: a smaller change is not called
_HANGING = float(np.radians(80.0))  # rad that knees are bent of somebody who has sat down
COUNTS = ("one", "two", "three", "four", "five", "six", "seven", "eight")
"""As seconds are counted."""
_STEP = 15.0  # degrees to which angles are rounded
_MOST = 4  # Things that a person can begin at once
PLANTED = ("knee_flexion",)
"""What is called of a leg that stands: its other joints follow from the feet."""
_ARMS = tuple((f"{side}_shoulder", f"{side}_elbow") for side in SIDES)
"""Beginnings of the names of the joints of the right and of the left arm."""
_OUT = -60.0  # degrees of shoulder_adduction from which an arm is held out to the side
_LIFTED = ("shoulder_flexion", "arm_front", "shoulder_adduction")  # Movements whose right angle is shoulder height
REST = "Then rest: let free arms down. Take up this posture again when you are ready."
"""What is called where the person rests (`rests`)."""
_PLURAL = {"foot": "feet"}
MIRROR_CALL = ("mirror: the same with right and left exchanged",)
"""What is called for the image of the last posture: one known thing."""


Say = Callable[..., str]
"""Says a text in some language, with values in the places of ``%(name)s``."""


def in_english(text: str, **values: str) -> str:
    """Return a text with its values, as it is written here."""
    return text % values


Number = Callable[[float, int], str]
"""Writes a number with so many digits after the decimal sign."""


def as_number(value: float, digits: int) -> str:
    """Return a number as English writes it."""
    return f"{value:.{digits}f}"


CueWords = tuple[str, str, str, str]
"""The part that moves, and what is called for a positive angle, a negative one and (nearly) none."""


@cache
def _words(group: str) -> dict[str, CueWords]:
    """Return the words of the ``joints``, of ``arms_out`` or of the ``hips``: ``protocols/vocabulary/cues.toml``."""
    return {name: tuple(words) for name, words in read_toml(locate("protocols/vocabulary", "cues"))[group].items()}


def cue_sheet(
    said: tuple[tuple[str, ...], ...],
    stances: tuple[str, ...],
    *,
    tempo: tuple[float, float] = (2.0, 2.0),
    names: tuple[str, ...] = (),
    about: tuple[str, ...] = (),
    rests: tuple[bool, ...] = (),
    say: Say = in_english,
    short: Callable[[float], str] = "{:g}".format,
) -> str:
    """Return the cue sheet (Markdown): what is ``said`` (P) on the way to each posture (`dance_instructions`), and in
    words where the feet are, ``stances`` (P); ``tempo`` s of a move and of a hold; ``names`` (P) of the postures, if
    they are known ones; ``about`` sentences that stand before them; ``rests`` (P) after which the person rests; all
    of these in the language of ``say``, which writes numbers as ``short`` does.
    """
    count = max(1, min(len(COUNTS), round(tempo[0])))
    title, counts = say("The dance, posture by posture"), say(" and ").join(say(one) for one in COUNTS[:count])
    lines = [
        f"# {title}",
        "",
        say(
            "Each posture: %(move)s s to get there, counted *%(counts)s*, then %(hold)s s of holding still. Only what "
            "moves is said; everything else stays as it is. Stop whenever something hurts or you lose your balance; "
            "the posture can be repeated.",
            move=short(tempo[0]),
            counts=counts,
            hold=short(tempo[1]),
        ),
        *(line for sentence in about for line in ("", sentence)),
    ]
    for i, (called, stance) in enumerate(zip(said, stances, strict=True)):
        if i == 0 or stance != stances[i - 1]:
            lines += ["", f"## {stance[:1].upper()}{stance[1:]}"]
        name = f"*{names[i][:1].upper()}{names[i][1:]}.* " if names else ""
        lines += ["", f"**{i + 1}.** {name}{_sentence(called, say)}"]
        lines += ["", say(REST)] if rests and rests[i] else []
    return "\n".join(lines) + "\n"


def rests(dance: Dance) -> tuple[bool, ...]:
    """Return whether the person rests after each posture (P): never after one in between, nor after the last one."""
    out, since = [], 0.0
    for p in range(len(dance.postures)):
        since += float(dance.hold[p] + (dance.move[p - 1] if p else 0.0))
        last = p + 1 == len(dance.postures)
        out.append(dance.rest is not None and since >= dance.rest and not last and dance.stances[p].over is None)
        since = 0.0 if out[-1] else since
    return tuple(out)


def calls(
    body: Body,
    before: Array,
    after: Array,
    planted: tuple[str, ...] = (),
    hips: tuple[Array, Array] = (np.zeros(3), np.zeros(3)),
    say: Say = in_english,
) -> tuple[str, ...]:
    """Return what is called on the way from angles ``before`` to ``after`` (n,) degrees, largest change first; ``hips``
    their turn to the left, drop to the right and tilt forward (3,) degrees before and after; as one may ``say`` it.
    """
    changes = {
        called: (start, end)
        for name, called, start, end in _movements(body, before, after)
        if abs(end - start) >= _SMALLEST and not _follows(name, planted)
    }
    whole_body = _words("hips")
    least = dict.fromkeys(whole_body, _SMALLEST)
    if any(f"{side}_knee_flexion" in changes for side in planted):
        least["hips_flexion"] = 30.0  # degrees by which hips lean of themselves
    changes |= {
        name: (float(b), float(a)) for name, b, a in zip(whole_body, *hips, strict=True) if abs(a - b) >= least[name]
    }
    found: list[tuple[float, str]] = []
    while changes:
        name = next(iter(changes))
        start, end = changes.pop(name)
        whole = name.replace("trunk", "hips")
        if whole != name and whole in changes and _together((start, end), changes[whole]):
            also = changes.pop(whole)
            size = max(abs(one[1] - one[0]) for one in ((start, end), also))
            trunk, hips_at = _call(name, "", start, end, say), _rounded(also[1])
            if _rounded(end) == hips_at:
                found.append((size, say("%(move)s, hips too", move=trunk)))
            else:  # the hips go, too, but not as far
                found.append((size, say("%(move)s, hips too, by about %(angle)s°", move=trunk, angle=f"{hips_at:.0f}")))
            continue
        side, movement = _split(name)
        other = f"{'left' if side == 'right' else 'right'}_{movement}"
        pair = side and other in changes and abs(changes[other][1] - end) <= 12.0  # degrees
        if pair:
            partner = changes.pop(other)
            start, end = (start + partner[0]) / 2, (end + partner[1]) / 2
        found.append((abs(end - start), _call(movement, "both" if pair else side, start, end, say)))
    return tuple(text for _, text in sorted(found, key=lambda call: -call[0]))


def _movements(body: Body, before: Array, after: Array) -> Iterator[tuple[str, str, float, float]]:
    """Yield the name of every joint, that of its words, and its angle before and after, degrees."""
    angles = {joint.name: (float(b), float(a)) for joint, b, a in zip(body.joints, before, after, strict=True)}
    for name, ends in angles.items():
        side, movement = _split(name)
        was, now = (angle <= _OUT for angle in angles.get(f"{side}_shoulder_adduction", (0.0, 0.0)))
        turned = movement == "shoulder_flexion" and now
        yield name, f"{side}_{'forearm_turn' if was else 'arm_front'}" if turned else name, *ends


def _together(trunk: tuple[float, float], hips: tuple[float, float]) -> bool:
    """Return whether trunk and hips go the same way, from angle to angle (degrees), both somewhere or both back."""
    same = (trunk[1] - trunk[0]) * (hips[1] - hips[0]) > 0
    return same and (_rounded(trunk[1]) == 0) == (_rounded(hips[1]) == 0)


def instructions(
    body: Body, before: Array, after: Array, was: Stance | None, now: Stance, say: Say = in_english
) -> tuple[str, ...]:
    """Return everything that is called on the way between two postures: what the feet do, then what moves.

    ``before``, ``after`` (n,) coordinates of the chain; ``was`` the feet before, None at the start, ``now`` after.
    """
    hips = tuple(np.degrees(np.array([1.0, 1.0, -1.0]) * x[ROOT - 3 : ROOT]) for x in (before, after))
    before, after = before[ROOT:], after[ROOT:]
    planted = tuple(SIDES[side] for side in now.planted)
    if was is None and now.seat:  # whoever sits lets the legs hang
        legs = [j for j, joint in enumerate(body.joints) if _is_leg(_split(joint.name)[1])]
        before = before.copy()
        before[legs] = [_HANGING if "knee" in body.joints[j].name else after[j] for j in legs]
    before = before.copy()
    for side in now.quiet:  # it hangs, or the hand stays on the frame and the arm follows of itself
        arm = [j for j, joint in enumerate(body.joints) if joint.name.startswith(_ARMS[side])]
        before[arm] = after[arm]
    moved = calls(body, np.degrees(before), np.degrees(after), planted, (hips[0], hips[1]), say)
    return (*map(say, _feet_calls(was, now)), *moved)


def dance_instructions(dance: Dance, say: Say = in_english) -> tuple[tuple[str, ...], ...]:
    """Return what is called on the way to each posture of a dance, (P); postures are numbered from 1 everywhere."""
    pairs = zip(dance.postures, dance.stances, strict=True)
    angles = [dance.chain.plant(x[None], s.planted, s.ankle)[0] for x, s in pairs]
    out = []
    for p, (after, now) in enumerate(zip(angles, dance.stances, strict=True)):
        before, was = (angles[p - 1], dance.stances[p - 1]) if p else (np.zeros_like(after), None)
        image = tuple(map(say, MIRROR_CALL))
        out.append(image if p in dance.mirrored else instructions(dance.body, before, after, was, now, say))
    return tuple(out)


def skipping(dance: Dance, p: int, before: int, say: Say = in_english) -> tuple[str, ...]:
    """Return what is called on the way to posture ``p`` straight from posture ``before``, on the same feet."""
    now = dance.stances[p]
    was, x = (dance.chain.plant(dance.postures[k][None], now.planted, now.ankle)[0] for k in (before, p))
    return instructions(dance.body, was, x, now, now, say)


def _feet_calls(was: Stance | None, now: Stance) -> tuple[str, ...]:
    """Return what the feet do between two stances, or what the hands take hold of at the start."""
    if was is None:
        if not now.holding:
            return ()
        hands = "both hands" if len(now.holding) == 2 else f"the {SIDES[now.holding[0]]} hand"
        return (f"hold the frame with {hands}",)
    if not np.array_equal(was.ankle, now.ankle):
        ahead = now.ankle[0, 0] > was.ankle[0, 0] + 1e-6
        return ("step forward with the right foot" if ahead else "set the right foot back beside the left one",)
    down = [SIDES[side] for side in now.planted if side not in was.planted]
    if down:
        return (f"set the {down[0]} foot down",)
    if now.over is not None and now.over != was.over:
        return (f"shift your weight onto the {SIDES[now.over]} leg",)
    return ()


def _split(name: str) -> tuple[str, str]:
    """Return side ("" for the trunk) and movement of a joint."""
    side = name.partition("_")[0]
    return (side, name.removeprefix(f"{side}_")) if side in SIDES else ("", name)


def _follows(name: str, planted: tuple[str, ...]) -> bool:
    """Return whether a joint is not called: it has no words, or follows from a foot that stands."""
    side, movement = _split(name)
    return movement not in _words("joints") or (side in planted and _is_leg(movement) and movement not in PLANTED)


def _is_leg(movement: str) -> bool:
    return movement.startswith(("hip", "knee", "ankle"))


def _call(movement: str, side: str, start: float, angle: float, say: Say) -> str:
    part, positive, negative, none = (_words("joints") | _words("arms_out") | _words("hips"))[movement]
    limbs = f"both {_PLURAL.get(part, part + 's')}" if side == "both" else f"the {side} {part}"
    whole = say(limbs) if part else ""
    rounded = _rounded(angle)
    back = say(none).format(whole)
    if rounded == 0:
        return back
    degrees = f"{rounded:.0f}"
    if start * angle > 0 and abs(start) > abs(angle) and rounded == _STEP:
        return say("%(move)s, all but about %(angle)s°", move=back, angle=degrees)
    high = say("to shoulder height") if movement in _LIFTED else say("to a right angle")
    size = high if rounded == 90 else say("by about %(angle)s°", angle=degrees)
    if start * angle > 0 and abs(start) > abs(angle):  # from a half squat 15° are less, not more
        size = say("only %(size)s", size=size)
    return say("%(move)s %(size)s", move=say(positive if angle > 0 else negative).format(whole), size=size)


def _rounded(angle: float) -> float:
    return _STEP * round(abs(angle) / _STEP)


def _sentence(said: tuple[str, ...], say: Say) -> str:
    """Return the calls as text: the first ``MOST``, then the rest."""
    if not said:
        still = say("stay as you are")
        return f"{still[:1].upper()}{still[1:]}."
    first, rest = "; ".join(said[:_MOST]), say("And also: %(calls)s.", calls="; ".join(said[_MOST:]))
    return f"{first[:1].upper()}{first[1:]}." + (f" {rest}" if said[_MOST:] else "")
