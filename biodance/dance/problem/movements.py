"""Movements of limbs as therapists name them, and the joints of a body that they move.

A movement is in plain English ("arm forward") or by its ISB joint ("shoulder flexion"), of one side ("left arm
forward") or of both; spaces, dots and underscores are the same.
"""

from biodance.errors import UnknownName
from biodance.records import SIDES

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
_LIMBS = {"arm": ("shoulder", "elbow"), "leg": ("hip", "knee", "ankle")}


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


def names_joint(key: str, joint: str) -> bool:
    """Return whether ``key`` names a joint, from coarse to fine: "all"; "left"; "arm" or "knee" (both sides);
    "left_arm" or "left_knee"; "left_knee_flexion".
    """
    side, _, bare = joint.partition("_") if joint.partition("_")[0] in SIDES else ("", "", joint)
    of, rest = next(((one, key[len(one) + 1 :]) for one in SIDES if f"{key}_".startswith(f"{one}_")), ("", key))
    if of and of != side:
        return False
    starts = _LIMBS.get(rest, (rest,))
    return key == "all" or not rest or any(f"{bare}_".startswith(f"{start}_") for start in starts)
