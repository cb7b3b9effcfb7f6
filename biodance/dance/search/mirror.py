"""The mirror image of a posture: right and left exchanged, for bodies whose sides are alike.

Only postures whose image stands on feet of the protocol have one: side by side, on the other leg, seated. The right
foot in front has none.
"""

import numpy as np

from biodance.body.body import Body
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.stance import Stance
from biodance.records import Array

ACROSS = {"parallel": "parallel", "single_right": "single_left", "single_left": "single_right", "seated": "seated"}
"""Feet of a posture, and of its image."""
FLIP = np.array([1.0, 1.0, -1.0])
"""Sense of the axes of a segment in the image (z to the right)."""
SIDEWAYS = ("_bending", "_rotation")
"""Ends of the names of middle joints that change their sense; paired ones have the anatomical sense on both sides."""
_SAME = 1e-9
"""m, kg, rad, N·m: differences between the sides that are rounding."""


def counterpart(name: str) -> str:
    """Return the name of the joint or segment on the other side; middle ones are their own."""
    for side, other in (("right_", "left_"), ("left_", "right_")):
        if name.startswith(side):
            return other + name.removeprefix(side)
    return name


def symmetric(body: Body) -> bool:
    """Return whether the body is the same on both sides: joints, limits, masses and boxes."""
    names, limits, segments = [joint.name for joint in body.joints], body.limits, list(body.segments)
    if set(map(counterpart, names)) != set(names) or set(map(counterpart, segments)) != set(segments):
        return False
    across, sense = _joints(names)
    other = [segments.index(counterpart(name)) for name in segments]
    places, axes, turns = (
        np.array([getattr(joint, name) for joint in body.joints]) for name in ("translation", "axis", "rotation")
    )
    bounds = np.array([[limits.lower, limits.upper], [limits.torque_lower, limits.torque_upper]])
    pairs: list[tuple[Array, Array]] = [
        (np.sort(sense * bounds[:, :, across], axis=1), bounds),
        (FLIP * places[across], places),
        (-FLIP * axes[across], sense[:, None] * axes),  # of a robot's rolls and yaws, both sides may turn the same way
        (FLIP[:, None] * turns[across] * FLIP, turns),
        (body.sip.mass[other], body.sip.mass),
        (FLIP * body.sip.com[other], body.sip.com),
        (np.sort(FLIP * body.boxes[other], axis=1), body.boxes),
    ]
    return all(np.allclose(image, own, rtol=0.0, atol=_SAME) for image, own in pairs)


def _joints(names: list[str]) -> tuple[list[int], Array]:
    """Return for every joint the index of the one whose angle it has in the image, and the sense (n,) of that angle."""
    middle = [counterpart(name) == name for name in names]
    sense = np.array(
        [-1.0 if alone and name.endswith(SIDEWAYS) else 1.0 for alone, name in zip(middle, names, strict=True)]
    )
    return [names.index(counterpart(name)) for name in names], sense


def image_feet(here: Stance, stances: tuple[Stance, ...]) -> int | None:
    """Return the place of the first of ``stances`` on which images of postures ``here`` stand, if there is one."""
    free = np.isnan(here.hands[::-1])
    alike = (
        k
        for k, there in enumerate(stances)
        if there.name == ACROSS.get(here.name) and np.array_equal(np.isnan(there.hands), free)
    )
    return next(alike, None)


def mirror_posture(chain: Chain, x: Array, here: Stance, there: Stance) -> Array:
    """Return the image (n,), on the feet ``there``, of a posture ``x`` (n,) on the feet ``here``."""
    across, sense = _joints([joint.name for joint in chain.body.joints])
    out = np.concatenate([x[:ROOT] * [1, -1, 1, -1, -1, 1], sense * x[ROOT:][across]])
    gap = there.ankle - here.ankle[::-1] * [1, -1, 1]
    out[:2] += gap[list(there.planted), :2].mean(axis=0) if there.planted else 0.0
    return np.asarray(out)


def mirror_vectors(body: Body, vectors: Array) -> Array:
    """Return the image (N, 3) of one vector for each segment, ``vectors`` (N, 3) in the segments' frames."""
    other = [body.segments.index(counterpart(name)) for name in body.segments]
    return np.asarray(FLIP * vectors[other])
