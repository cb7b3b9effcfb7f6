"""Segment frames of a standing person from the joint centres."""

from dataclasses import dataclass

import numpy as np

from biodance.body.joint_centres import unit
from biodance.body.static_centres import SIGN, UP, Centres, Places
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Frames:
    """Segment frames in the lab: ``rotation`` segment -> (3, 3) lab_R_segment, ``origin`` segment -> (3,) m (the proximal joint centre);
    ``ends`` side_wrist -> (3,) m; ``cut`` (3,) m where the table cuts pelvis from trunk.
    """

    rotation: Places
    origin: Places
    ends: Places
    cut: Array


def segment_frames(centres: Centres) -> Frames:
    """Return the 12 segment frames.

    Pelvis: ISB axes, origin in the middle of the hip centres. trunk_head: y along the line from mid hip to mid shoulder. Thigh, upper
    arm: y to the proximal joint, z in the plane of the flexion axis. Shank, forearm: y to the proximal joint, flexed about the parent's
    z and tilted by a constant varus. Foot: flat on the ground, x from heel to toe.
    """
    at = centres.place
    hips, shoulders = ((at[f"right_{joint}"] + at[f"left_{joint}"]) / 2 for joint in ("hip", "shoulder"))
    axis = shoulders - hips
    rotation = {"pelvis": centres.pelvis, "trunk_head": frame_yz(axis, at["right_shoulder"] - at["left_shoulder"])}
    origin = {"pelvis": hips, "trunk_head": at["trunk"]}
    for side in SIGN:
        for names, joints in (
            (("thigh", "shank"), ("hip", "knee", "ankle")),
            (("upper_arm", "forearm_hand"), ("shoulder", "elbow", "wrist")),
        ):
            limb = (f"{side}_{names[0]}", f"{side}_{names[1]}")
            _chain(rotation, origin, limb, tuple(at[f"{side}_{joint}"] for joint in joints), centres.right[f"{side}_{joints[1]}"])
        origin[f"{side}_foot"] = at[f"{side}_ankle"]
        rotation[f"{side}_foot"] = frame_yz(UP, centres.across[side])
    ends = {f"{side}_wrist": at[f"{side}_wrist"] for side in SIGN}
    return Frames(rotation, origin, ends, hips + centres.cut * axis)


def frame_yz(up: Array, right: Array) -> Array:
    """Return (3, 3) with y along ``up``, z as near to ``right`` as it can be, x forwards."""
    y = unit(up)
    x = unit(np.cross(y, right))
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _chain(rotation: dict[str, Array], origin: dict[str, Array], names: tuple[str, str], centres: tuple[Array, ...], right: Array) -> None:
    """Fill in the two segments of a limb: the second flexes about z of the first and is tilted about its own x (varus)."""
    (upper, lower), (top, middle, end) = names, centres
    rotation[upper], origin[upper], origin[lower] = frame_yz(top - middle, right), top, middle
    direction = rotation[upper].T @ unit(middle - end)
    flexion, varus = np.arctan2(-direction[0], direction[1]), np.arcsin(direction[2])
    rotation[lower] = rotation[upper] @ turn(2, flexion) @ turn(0, varus)


def turn(axis: int, angle: float) -> Array:
    """Return the rotation (3, 3) about x, y or z (0, 1, 2) by ``angle`` rad."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(3)
    out[i, i] = out[j, j] = np.cos(angle)
    out[j, i], out[i, j] = np.sin(angle), -np.sin(angle)
    return out
