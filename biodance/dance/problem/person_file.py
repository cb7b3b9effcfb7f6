"""The TOML file of one person's limits (``--limits FILE``), in the words of therapists; every key may be left out.

    reason = "stroke in March, left side"      for the record
    cannot = ["stand on left leg", "turn"]     or "stand", "stand on right leg", "lift arms over shoulder height"
    hold_frame = ["right"]                     hands that stay on the grips of a walking frame, of rails or bars
    max_speed_deg_s = 120                      no joint turns faster
    seat_height_m = 0.60                       of the stool; the feet hang
    stand_alone_on = ["right"]                 legs on which the person may stand alone; [] = never; without it: both
    seated = false                             true: only protocols on a stool (cannot = ["stand"])

    [at_most_deg]                              how far a movement goes
    "left arm lift" = 70                       in every direction; or forward and sideways apart
    "left arm forward" = 70
    "left arm sideways" = 60
    left_hip_internal_rotation = 0             names of the ISB do as well
    [weight_bearing]                           share of the weight that a leg may bear
    left = 0.6
    [strength]                                 share of the usual strength
    left_arm = 0.5
    [range_share]                              share of the usual range, towards the upright posture
    left = 0.7
    [range_deg]                                what a joint reaches, from and to, also by the movement's name
    left_knee_flexion = [20, 90]

A key of the last three names joints from the coarse to the fine: "all"; "left"; "arm", "leg" or "knee" (both sides);
"left_arm"; "left_knee"; "left_knee_flexion". Several that name the same joint act one after the other. A movement is in
plain English ("arm forward") or by its ISB joint ("shoulder flexion"), of one side or of both; spaces, dots and
underscores are the same. Angles are positive in the direction of the name. What an arm is lifted at most holds whatever
the joint angles by which (`limits._person`); where only one direction is named it holds for both.
"""

import math
from pathlib import Path
from typing import Any

from biodance.dance.problem.person import PersonLimits, Shares
from biodance.dance.problem.plan import finite_number, table
from biodance.errors import BiodanceError, UnknownName
from biodance.library import read_toml
from biodance.records import SIDES

_TABLES = ("at_most_deg", "weight_bearing", "strength", "range_share", "range_deg")
_KEYS = ("reason", "cannot", "hold_frame", "max_speed_deg_s", "seat_height_m", "stand_alone_on", "seated", *_TABLES)
_OVERHEAD = "lift arms over shoulder height"
_CANNOT = ("stand", *(f"stand on {side} leg" for side in SIDES), "turn", _OVERHEAD)
_RIGHT_ANGLE = math.pi / 2
_SEAT = (0.3, 1.2)
"""m that a seat may be high."""
_Ranges = list[tuple[str, float, float]]

_ARM_LIFT = (("shoulder_flexion", 1), ("shoulder_adduction", -1))
_MOVES: dict[str, tuple[tuple[str, int], ...]] = {
    "arm_lift": _ARM_LIFT,
    "shoulder_elevation": _ARM_LIFT,
    "arm_forward": (("shoulder_flexion", 1),),
    "arm_sideways": (("shoulder_adduction", -1),),
    "shoulder_abduction": (("shoulder_adduction", -1),),
    "arm_backward": (("shoulder_flexion", -1),),
    "shoulder_extension": (("shoulder_flexion", -1),),
    "arm_turn_in": (("shoulder_rotation", 1),),
    "shoulder_internal_rotation": (("shoulder_rotation", 1),),
    "arm_turn_out": (("shoulder_rotation", -1),),
    "shoulder_external_rotation": (("shoulder_rotation", -1),),
    "elbow_bend": (("elbow_flexion", 1),),
    "hip_bend": (("hip_flexion", 1),),
    "leg_backward": (("hip_flexion", -1),),
    "hip_extension": (("hip_flexion", -1),),
    "leg_sideways": (("hip_adduction", -1),),
    "hip_abduction": (("hip_adduction", -1),),
    "leg_across": (("hip_adduction", 1),),
    "leg_turn_in": (("hip_rotation", 1),),
    "hip_internal_rotation": (("hip_rotation", 1),),
    "leg_turn_out": (("hip_rotation", -1),),
    "hip_external_rotation": (("hip_rotation", -1),),
    "knee_bend": (("knee_flexion", 1),),
    "foot_up": (("ankle_dorsiflexion", 1),),
    "foot_down": (("ankle_dorsiflexion", -1),),
    "ankle_plantarflexion": (("ankle_dorsiflexion", -1),),
    "foot_turn_in": (("ankle_inversion", 1),),
    "foot_turn_out": (("ankle_inversion", -1),),
    "ankle_eversion": (("ankle_inversion", -1),),
    "trunk_bow": (("trunk_flexion", 1),),
    "trunk_extension": (("trunk_flexion", -1),),
    "trunk_lean": (("trunk_bending", 1), ("trunk_bending", -1)),
    "trunk_turn": (("trunk_rotation", 1), ("trunk_rotation", -1)),
}
"""Movement: its joints without side, and the sense in which each turns (1: that of its name)."""
_JOINTS = tuple(dict.fromkeys(joint for moves in _MOVES.values() for joint, _ in moves))


def read_person(path: str | Path) -> PersonLimits:
    """Return the limits in a person's TOML file.

    Raises
    ------
    UnknownName
        A key, a leg or a movement does not exist. (Joints are looked up later, in the body.)
    BiodanceError
        The file cannot be read, or a value is not legal; the message names file, key, value and what would be legal.
    """
    path = Path(path)
    raw = read_toml(path)
    for key in raw:
        if key not in _KEYS:
            raise UnknownName.of(f"key of {path}", key, _KEYS)
    cannot = _listed(path, raw, "cannot", "movement", _CANNOT)
    barred = [side for side in SIDES if f"stand on {side} leg" in cannot]
    legs = [leg for leg in _listed(path, raw, "stand_alone_on", "leg", SIDES, usual=SIDES) if leg not in barred]
    seated = raw.get("seated", False)
    if not isinstance(seated, bool):
        raise BiodanceError(f"{path}: seated = {seated!r}; expected true or false.")
    ranges = [*_at_most(path, raw), *_ranges(path, raw)]
    if "turn" in cannot:
        ranges.append(("trunk_rotation", 0.0, 0.0))
    if _OVERHEAD in cannot:
        ranges += [("shoulder_flexion", -math.inf, _RIGHT_ANGLE), ("shoulder_adduction", -_RIGHT_ANGLE, math.inf)]
    shares, strengths, bearing = (_shares(path, raw, name) for name in ("range_share", "strength", "weight_bearing"))
    for side, _ in bearing:
        if side not in SIDES:
            raise UnknownName.of(f"leg in weight_bearing of {path}", side, SIDES)
    return PersonLimits(
        tuple(ranges),
        shares,
        strengths,
        math.radians(_positive(path, raw, "max_speed_deg_s", math.inf)),
        tuple(legs),
        seated or "stand" in cannot,
        str(raw.get("reason", "")),
        tuple(_listed(path, raw, "hold_frame", "hand", SIDES)),
        bearing,
        _OVERHEAD in cannot,
        _positive(path, raw, "seat_height_m", 0.0, legal=_SEAT),
    )


def _listed(
    path: Path, raw: dict[str, Any], key: str, what: str, legal: tuple[str, ...], *, usual: tuple[str, ...] = ()
) -> list[str]:
    """Return the words of a list in the file, each naming ``what``."""
    found = raw.get(key, [*usual])
    if not isinstance(found, list):
        raise BiodanceError(f"{path}: {key} = {found!r}; expected a list of {', '.join(legal)}, as {[legal[0]]}.")
    for one in found:
        if one not in legal:
            raise UnknownName.of(f"{what} in {key} of {path}", str(one), legal)
    return found


def _positive(
    path: Path, raw: dict[str, Any], key: str, usual: float, *, legal: tuple[float, float] = (0.0, math.inf)
) -> float:
    if key not in raw:
        return usual
    value = finite_number(path, key, raw[key])
    if not (value > 0 and legal[0] <= value <= legal[1]):
        between = f" and lie between {legal[0]:g} and {legal[1]:g}" if legal[0] else ""
        raise BiodanceError(f"{path}: {key} = {raw[key]!r}; it must be positive{between}.")
    return value


def _at_most(path: Path, raw: dict[str, Any]) -> _Ranges:
    """Return the ranges (joint, lower, upper) rad of movements that go so far at most."""
    out: _Ranges = []
    for key, value in _flat(table(path, raw, "at_most_deg")).items():
        angle = finite_number(path, f"at_most_deg.{key}", value)
        if not 0 <= angle <= 180:
            raise BiodanceError(f"{path}: at_most_deg.{key} = {angle:g}; expected 0 to 180 degrees in its direction.")
        for joint, sense in moved_joints(key, f"at_most_deg of {path}"):
            low, high = sorted((math.radians(angle) * sense, -math.inf * sense))
            out.append((joint, low, high))
    return out


def _flat(values: dict[str, Any], before: str = "") -> dict[str, Any]:
    """Return a table of tables as one: ``left_arm.forward``."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        out |= _flat(value, f"{before}{key} ") if isinstance(value, dict) else {before + key: value}
    return out


def _ranges(path: Path, raw: dict[str, Any]) -> _Ranges:
    """Return the ranges (key, lower, upper) rad of joints or of movements with one joint and direction."""
    out: _Ranges = []
    for key, value in table(path, raw, "range_deg").items():
        if not isinstance(value, list) or len(value) != 2:
            raise BiodanceError(f"{path}: range_deg.{key} = {value!r}; expected [lower, upper] in degrees.")
        low, high = (math.radians(finite_number(path, f"range_deg.{key}", one)) for one in value)
        moved = named_movement(key)
        if moved is not None and len(moved) > 1:
            raise BiodanceError(
                f"{path}: range_deg.{key} = {value!r}; this movement has no lower end. Write {key} = {value[1]!r} "
                f"under [at_most_deg]."
            )
        joint, sense = (plain(key), 1) if moved is None else moved[0]
        out.append((joint, low, high) if sense > 0 else (joint, -high, -low))
    return out


def _shares(path: Path, raw: dict[str, Any], name: str) -> Shares:
    found = tuple(
        (plain(key), finite_number(path, f"{name}.{key}", value)) for key, value in table(path, raw, name).items()
    )
    for key, value in found:
        if not 0 <= value <= 1:
            raise BiodanceError(f"{path}: {name}.{key} = {value:g}; a share lies between 0 and 1.")
    return found


def moved_joints(key: str, where: str) -> tuple[tuple[str, int], ...]:
    """Return the joints, with the side if ``key`` names one, and senses of a movement; UnknownName, found ``where``, if
    there is none of this name.
    """
    moved = named_movement(key)
    if moved is None:
        raise UnknownName.of(f"movement in {where}", key, (*_MOVES, *_JOINTS))
    return moved


def named_movement(key: str) -> tuple[tuple[str, int], ...] | None:
    """Return the joints and senses of a movement, None if there is none of this name."""
    name = plain(key).replace("lift_", "")
    side = next((f"{one}_" for one in SIDES if name.startswith(f"{one}_")), "")
    bare = name.removeprefix(side)
    moves = ((bare, 1),) if bare in _JOINTS else _MOVES.get(bare)
    return None if moves is None else tuple((f"{side}{joint}", sense) for joint, sense in moves)


def plain(key: str) -> str:
    """Return a key with underscores only: ``left arm.forward`` -> ``left_arm_forward``."""
    return "_".join(key.replace(".", " ").split())
