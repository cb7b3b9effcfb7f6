"""Why there is no dance: a foot configuration in which no posture keeps all limits, and the one limit without which there would be one.

The search is local, from several starts: "none was found", and which limit was in the way, is what it can say - and what a person needs.
"""

import math

import numpy as np

from biodance.dance.chain import Chain
from biodance.dance.limits import limits
from biodance.dance.postures import STATIC, free_coordinates, start
from biodance.dance.programme import Programme
from biodance.dance.sqp import minimise
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.errors import BiodanceError
from biodance.records import Array

STARTS = 6
"""Starts of the search; healthy persons need one."""
EXCUSED = 1e-3
"""Violation, in the scale of a limit, that counts as none."""
PERSONAL = ("joint_torque", "joint_range", "balance", "self_collision", "seat", "ground_clearance", "foot_placement")
"""The limits in the order in which they are suspected: first those in which persons differ."""


class NoDance(BiodanceError):
    """A dance that cannot exist: the sentence names the protocol, the feet, and the constraint that forbids it."""


def check_postures(chain: Chain, stances: tuple[Stance, ...], *, seed: int = 0) -> None:
    """Return where each of the ``stances`` has a posture that keeps every limit.

    Raises
    ------
    NoDance
        For one of them none was found; the message names the limit, the joint and what is missing.
    """
    for number, stance in enumerate(stances):
        violation, words = nearest(chain, stance, rng=np.random.default_rng([seed, number]))
        if violation > EXCUSED:
            raise NoDance(f"No posture {told(stance)} keeps all limits; {words}. Change the limits, or leave this stance out.")


def nearest(chain: Chain, stance: Stance, *, rng: np.random.Generator) -> tuple[float, str]:
    """Return the smallest violation found (in the scale of its limit; negative: room is left) and, if it counts, why in words."""
    best, state = _search(chain, stance, STATIC, rng)
    if best <= EXCUSED:
        return best, ""
    for name in PERSONAL:
        others = tuple(other for other in STATIC if other != name)
        relaxed, without = _search(chain, stance, others, rng)
        if relaxed <= EXCUSED:
            return best, f"there would be one without the {describe(without, (name,))}"
    return best, f"at best the {describe(state, STATIC)}"


def _search(chain: Chain, stance: Stance, names: tuple[str, ...], rng: np.random.Generator) -> tuple[float, State]:
    """Return the smallest violation of the named limits that was found, and the posture."""
    free, kept = free_coordinates(chain, stance), tuple(limit for limit in limits() if limit.NAME in names)
    best, state = math.inf, None
    for _ in range(STARTS):
        begin = start(chain, stance, rng)
        base, basis = np.zeros((3, 1, chain.size)), np.ones((3, 1, 1)) * [[[1.0]], [[0.0]], [[0.0]]]
        base[0, 0] = begin
        base[0, 0, free] = 0.0
        programme = Programme(chain, stance, base, basis, free, kept, _nothing, np.zeros((1, len(kept))))
        found = minimise(programme.judge, begin[free], iterations=60)
        if found.violation < best:
            best, state = found.violation, programme.state(found.y)
        if best <= EXCUSED:
            break
    assert state is not None
    return best, state


def describe(state: State, names: tuple[str, ...]) -> str:
    """Return in words which of the named limits the state (one sample) breaks most, where, and by how much."""
    found = [(limit, limit.margins(state).value) for limit in limits() if limit.NAME in names]
    limit, value = min(found, key=lambda pair: float(pair[1].min(initial=np.inf)) / pair[0].SCALE)
    column = int(np.argmin(value[0]))
    missing, unit = -float(value[0, column]), limit.UNIT
    if unit == "rad":
        missing, unit = math.degrees(missing), "degrees"
    elif unit == "m":
        missing, unit = 100 * missing, "cm"
    joints = [joint.name.replace("_", " ") for joint in state.chain.body.joints]
    where = f" of {joints[column % len(joints)]}" if limit.NAME.startswith("joint_") else ""
    return f"limit on {limit.NAME.replace('_', ' ')}{where}, which falls short by about {missing:.0f} {unit}"


def told(stance: Stance) -> str:
    """Return where the feet are, in words."""
    return {
        "parallel": "with both feet side by side",
        "right_forward": "with the right foot in front",
        "single_right": "on the right leg alone",
        "single_left": "on the left leg alone",
        "seated": "on the stool",
    }[stance.name]


def _nothing(state: State) -> tuple[float, Array]:
    return 0.0, np.zeros((3, *state.x.shape))
