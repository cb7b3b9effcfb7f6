"""All postures of one foot configuration that words can make, with the pelvis where it keeps the balance.

The joints of trunk, arms and lifted leg are what the words say; planted legs follow from the feet, and the pelvis
goes where the centre of mass is over the middle of the support and the knees bend as said.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from biodance.dance.dance import Dance
from biodance.dance.limits import Limit
from biodance.dance.performers import deviations_of_copies
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State
from biodance.dance.search.mirror import counterpart
from biodance.dance.search.vocabulary import Vocabulary, Word, own_joint
from biodance.records import SIDES, Array

_ROUNDS = 5
"""Corrections of the pelvis; each leaves about a fifth of the error."""
_BACK = 0.03
"""m behind the middle of the support where people stand: over the arch of the foot."""
_GRIPPED, _STEPS, _DAMPING = 2, 12, 1e-3
"""Times that holding arms are bent and the pelvis is set anew, least-squares steps of each, and their damping, m²."""
_ELBOW_OUT = tuple(np.radians([0.0, -60.0, 40.0, 60.0]))
"""rad (shoulder flexion, adduction, rotation, elbow flexion) which a holding arm comes near to: away from the trunk."""
_FROM_STOP = float(np.radians(3.0))
"""rad that the joints of a holding arm keep from their stops."""
_TURN, _LEAN, _TILT = ROOT - 3, ROOT - 2, ROOT - 1
"""Coordinates of the pelvis' turn to the left, of its lean to the right, and of its tilt backward."""


@dataclass(frozen=True, eq=False)
class PostureTable:
    """``words`` of every part of the body on the feet of ``stance``; posture s has the words ``index[s]`` (S, parts)
    and the coordinates ``x`` (S, n).
    """

    chain: Chain
    stance: Stance
    words: Vocabulary
    index: NDArray[np.intp]
    x: Array

    @classmethod
    def of(cls, chain: Chain, stance: Stance, words: Vocabulary) -> "PostureTable":
        """Return all combinations of ``words`` on the feet ``stance``."""
        index = np.array(list(product(*(range(len(group)) for group in words.values()))), dtype=np.intp)
        return cls(chain, stance, words, index, posed(chain, stance, words, index))

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """What moves, in the order of the columns of ``index``."""
        return tuple(self.words)

    @cached_property
    def mirrored(self) -> NDArray[np.intp]:
        """(S,) number of the posture with the sides exchanged, -1 where there is none."""
        if any("lifted" in part for part in self.parts):
            return np.full(len(self.index), -1)
        place = {tuple(row): s for s, row in enumerate(self.index)}
        names = {part: [word.key for word in group] for part, group in self.words.items()}
        other = {part: counterpart(part) for part in self.parts}
        out = np.full(len(self.index), -1)
        for s, row in enumerate(self.index):
            keys = {other[part]: self.words[part][k].mirror for part, k in zip(self.parts, row, strict=True)}
            if all(keys[part] in names[part] for part in self.parts):
                out[s] = place[tuple(names[part].index(keys[part]) for part in self.parts)]
        return out

    @cached_property
    def arms_at_rest(self) -> NDArray[np.intp]:
        """(S,) number of the posture that does the same but for the arms, which rest."""
        still = np.where([part.endswith("_arm") for part in self.parts], 0, self.index)
        return np.ravel_multi_index(tuple(still.T), tuple(len(group) for group in self.words.values()))

    def words_of(self, s: int) -> dict[str, Word]:
        """Return the word of every part of posture ``s``."""
        return {part: self.words[part][k] for part, k in zip(self.parts, self.index[s], strict=True)}

    def keeps(self, s: int, limits: tuple[Limit, ...]) -> tuple[float, str]:
        """Return by how many deviations of imprecise people posture ``s`` keeps the limits and the one of which that is
        least; minus infinity where itself it breaks one or leaves too little for moves.
        """
        state = State(self.chain, self.stance, self.x[s : s + 1], *np.zeros((2, 1, self.chain.size)))
        for limit in (limit for limit in limits if limit.at_rest):
            if (limit.margins(state).value < limit.straight_reserve(self.stance) * limit.scale).any():
                return -np.inf, limit.name
        no_way = np.empty((0, 2, self.chain.size))
        held = Dance("", self.chain.body, state.x, (self.stance,), np.ones(1), no_way, np.empty(0), (), 0)
        return deviations_of_copies(held, limits, np.zeros(1))


def posed(chain: Chain, stance: Stance, words: Vocabulary, index: NDArray[np.intp]) -> Array:
    """Return the coordinates (S, n) of the postures with the words ``index`` (S, parts)."""
    x, knee, names = np.zeros((len(index), chain.size)), np.zeros(len(index)), _columns(chain)
    for column, (part, group) in enumerate(words.items()):
        for k, word in enumerate(group):
            rows = index[:, column] == k
            turn, aside, ahead = (0.0, 0.0, 0.0) if stance.seat else word.pelvis  # whoever sits keeps it on the seat
            x[rows, _TURN] += turn
            x[rows, _LEAN] += -aside if part.startswith("right") else aside
            x[rows, _TILT] -= ahead
            for joint, angle in word.angles:
                if part == "legs" and joint == "knee_flexion":
                    knee[rows] = angle
                elif (name := own_joint(part, joint)) in names:
                    x[rows, names[name]] = angle
    for _ in range(_GRIPPED if stance.holding else 0):
        x = _gripping(chain, stance, settled(chain, stance, x, knee))
    return settled(chain, stance, x, knee)


def _gripping(chain: Chain, stance: Stance, x: Array) -> Array:
    """Return coordinates ``x`` (S, n) with the holding arms bent so that the palms come to their grips, or as near as
    their joints reach: by least squares, step by step.
    """
    x, limits = x.copy(), chain.body.limits
    for side in stance.holding:
        segment, local = palm(chain.body, SIDES[side])
        arm = chain.arm_columns[side]
        low, high = limits.lower[np.array(arm) - ROOT] + _FROM_STOP, limits.upper[np.array(arm) - ROOT] - _FROM_STOP
        for _ in range(_STEPS):
            place, slope = State(chain, stance, x, *np.zeros((2, *x.shape))).points([segment], local[None])
            J, out = slope[:, 0][:, :, arm], np.array(_ELBOW_OUT) - x[:, arm]
            inverse = np.swapaxes(J, 1, 2) @ np.linalg.inv(J @ np.swapaxes(J, 1, 2) + _DAMPING * np.eye(3))
            left = stance.hands[side] - place[:, 0] - np.einsum("sij,sj->si", J, out)
            step = np.einsum("sij,sj->si", inverse, left) + out
            x[:, arm] = np.clip(x[:, arm] + step, np.minimum(low, high), np.maximum(low, high))
    return x


def _columns(chain: Chain) -> dict[str, int]:
    return {joint.name: ROOT + j for j, joint in enumerate(chain.body.joints)}


def settled(chain: Chain, stance: Stance, x: Array, knee: Array) -> Array:
    """Return coordinates ``x`` (S, n) with the pelvis over the middle of the support and the planted ``knee`` (S,) rad
    bent; of a person on a stool on the seat.
    """
    x = x.copy()
    if stance.seat:
        x[:, 2] = stance.seat
        return x
    x[:, :2] = middle = _middle(stance)
    for _ in range(_ROUNDS):
        x[:, 2] = chain.root_heights(x, stance.ankle, knee, stance.planted).min(axis=0)
        x = chain.plant(x, stance.planted, stance.ankle)
        x[:, :2] += middle - chain.mass_centre(x)[:, :2]
    x[:, 2] = chain.root_heights(x, stance.ankle, knee, stance.planted).min(axis=0)
    return chain.plant(x, stance.planted, stance.ankle)


def _middle(stance: Stance) -> Array:
    """Return the point (2,) m over which people stand: behind the middle of the support, or of the foot that bears."""
    along = stance if stance.over is None else stance.on(stance.over)
    return np.array([along.centre[0] - _BACK, stance.centre[1]])
