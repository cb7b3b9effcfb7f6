"""Postures that people know, limb by limb (``protocols/vocabulary/people.toml``), and all whole postures that these
words can make on given feet, with the pelvis where it keeps the balance.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.expectation import standing_regressors
from biodance.dance.limits import Limit
from biodance.dance.performers import deviations_of_copies
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State
from biodance.dance.search.postures import counterpart, describe
from biodance.errors import BiodanceError
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array

_FLAGS = ("rest", "gentle", "deep", "lively", "double")
_KEYS = ("name", "angles", "mirror", *_FLAGS)
_GROUPS = ("arm", "trunk", "legs", "lifted", "hanging")
PELVIS_TURN, PELVIS_LEAN, PELVIS_TILT = _PELVIS = ("pelvis_turn", "pelvis_lean", "pelvis_tilt")
"""Angles of a word that are no joint's: how far the pelvis turns to the left, leans towards the leg that stands (of
words of the trunk: to the right), and leans forward.
"""
_FREE = {
    "shoulder_flexion": (0, 30, 60, 90, 120),
    "shoulder_adduction": (-45, -60, -75, -90),
    "shoulder_rotation": (-30, 0, 30),
    "elbow_flexion": (10, 45, 75, 105),
}
"""degrees: what free postures of an arm are drawn from; away from trunk and thighs."""
_JOINTS = {"arm": ("shoulder", "elbow"), "trunk": ("trunk",)} | dict.fromkeys(
    ("lifted", "hanging"), ("hip", "knee", "ankle")
)
"""Joints by what moves."""
_FITS = np.radians(25.0)
"""rad: a word is not asked of whom it would be shortened by more in a joint, or by half of its greatest angle."""
_CUT = np.radians(10.0)  # rad by which a word may be cut short without saying so
_STOP = np.radians(1.5)  # rad that a word keeps from a joint's stop


@dataclass(frozen=True)
class Word:
    """What one group of joints does: ``angles`` (joint without side, rad), positive in the joint's anatomical sense.

    ``text`` as it is called; ``mirror`` the key of the word that does the same on the other side.
    """

    key: str
    text: str
    angles: tuple[tuple[str, float], ...]
    mirror: str
    rest: bool = False
    gentle: bool = False
    deep: bool = False
    lively: bool = False
    double: bool = False

    @property
    def pelvis(self) -> tuple[float, float, float]:
        """How far the pelvis turns to the left, leans towards the leg that stands, and leans forward, rad."""
        angles = dict(self.angles)
        return angles.get(PELVIS_TURN, 0.0), angles.get(PELVIS_LEAN, 0.0), angles.get(PELVIS_TILT, 0.0)


_HOLDING = Word(
    "hold", "{} hands on the frame", (("shoulder_adduction", -0.3), ("elbow_flexion", 0.7)), "hold", rest=True
)
"""What an arm does that holds a frame: from these angles it is bent to its grip (`posed`)."""

_HANGING = Word(
    "hang", "{} arms hanging", (("shoulder_adduction", -np.radians(12.0)), ("elbow_flexion", 0.2)), "hang", rest=True
)
"""What an arm does that is asked for nothing: beside the body, as far from it as a hip is wide."""

_FREE_ARM = "{} arms as in the picture"
IN_PART = "as far as you may"
"""What is added to the name of a word that this person can do in part."""

Vocabulary = dict[str, tuple[Word, ...]]
"""Group: its words, the one for rest first."""


def read_vocabulary() -> Vocabulary:
    """Return the words of ``protocols/vocabulary/people.toml``.

    Raises
    ------
    BiodanceError
        A group is missing or unknown, a key is unknown, a group has not one word for rest, or a mirror image
        is missing.
    """
    path = locate("protocols/vocabulary", "people")
    raw = read_toml(path)
    if set(raw) != set(_GROUPS):
        raise BiodanceError(f"{path}: groups {', '.join(sorted(raw))}; expected {', '.join(_GROUPS)}.")
    found = {}
    for group in _GROUPS:
        words = list[Word]()
        for key, said in raw[group].items():
            if unknown := set(said) - set(_KEYS):
                legal = ", ".join(_KEYS)
                raise BiodanceError(f"{path}: {group}.{key}: unknown key {sorted(unknown)[0]!r}; legal are {legal}.")
            angles = tuple((joint, float(np.radians(angle))) for joint, angle in said.get("angles", {}).items())
            flags = {name: bool(said.get(name, False)) for name in _FLAGS}
            words.append(Word(key, str(said["name"]), angles, str(said.get("mirror", key)), **flags))
        words.sort(key=lambda word: not word.rest)
        keys = [word.key for word in words]
        if [word.rest for word in words] != [True] + [False] * (len(words) - 1):
            raise BiodanceError(f"{path}: {group} needs exactly one word with rest = true.")
        if lost := [word.mirror for word in words if word.mirror not in keys]:
            raise BiodanceError(f"{path}: {group} names the mirror image {lost[0]!r}, which is not there.")
        found[group] = tuple(words)
    return found


def posture_phrases() -> tuple[str, ...]:
    """Return all parts of which names of postures are made, a comma and a space between them: words of limbs, those of
    paired limbs of both and of each, and `IN_PART`; what a limb does of which nothing is asked is not named.
    """
    texts = [word.text for group in read_vocabulary().values() for word in group if not word.rest]
    sides = ("both", *(f"the {side}" for side in SIDES))
    out = ["stand", "sit"]
    for text in (*texts, _FREE_ARM):
        out += [singular(text.format(side)) if side != "both" else text.format(side) for side in sides]
    return tuple(dict.fromkeys(part for one in (*out, IN_PART) for part in one.split(", ")))


def groups_of(stance: Stance) -> dict[str, str]:
    """Return what moves on these feet: part of the body (``right_arm``, ``trunk``, ``legs``, ``left_lifted`` ...) and
    the group of words that it takes.
    """
    parts = {"trunk": "trunk", **{f"{side}_arm": "arm" for side in SIDES}}
    if stance.seat:
        return parts | {f"{side}_hanging": "hanging" for side in SIDES}
    up = [SIDES[side] for side in (0, 1) if side not in stance.planted]
    return parts | {"legs": "legs"} | {f"{side}_lifted": "lifted" for side in up}


def words_for(body: Body, plan: Plan, stance: Stance, words: Vocabulary, rng: np.random.Generator) -> Vocabulary:
    """Return for every part of `groups_of` what this person may be asked on these feet, rest first; ``rng`` draws the
    free postures of the arms.
    """
    free = () if plan.gentle else free_words(rng)
    out: Vocabulary = {}
    for part, group in groups_of(stance).items():
        quiet = _quiet(stance, part)
        asked = [quiet] if quiet else _asked(plan, stance, (*words[group], *(free if group == "arm" else ())))
        kept = [word for word in asked if stance.over is None or word.rest or group == "arm"]
        fitted = (_fitted(body, plan, part, word) for word in kept)
        out[part] = tuple(word for word in fitted if word is not None)
    return out


def _quiet(stance: Stance, part: str) -> Word | None:
    """Return what an arm does that holds a frame or hangs, None of other parts of the body."""
    arms = {f"{SIDES[side]}_arm": _HOLDING if side in stance.holding else _HANGING for side in stance.quiet}
    return arms.get(part)


def _asked(plan: Plan, stance: Stance, words: tuple[Word, ...]) -> list[Word]:
    """Return the words of a group that a plan asks for on these feet."""
    alone = len(stance.planted) == 1
    return [
        word
        for word in words
        if (plan.deep or not word.deep)
        and (plan.lively or not word.lively)
        and (word.gentle or not plan.gentle)
        and not (alone and word.double)
    ]


def words_left_out(body: Body, plan: Plan, stances: tuple[Stance, ...], words: Vocabulary) -> tuple[str, ...]:
    """Return a sentence for every part of the body that cannot do all that the plan asks of others: which words, and
    which joint does not reach so far.
    """
    found: dict[str, dict[str, str]] = {}
    for stance in stances:
        for part, group in groups_of(stance).items():
            for word in [] if _quiet(stance, part) else _asked(plan, stance, words[group]):
                if joint := _short_of(body, plan, part, word):
                    side = part.partition("_")[0]
                    text = singular(word.text.format(f"the {side}"))
                    found.setdefault(part, {})[text] = joint.replace("_", " ")
    return tuple(
        f"Left out for the {part.replace('_', ' ')}: {', '.join(texts)}; not within reach of "
        f"{', '.join(dict.fromkeys(texts.values()))}."
        for part, texts in found.items()
    )


def free_words(rng: np.random.Generator) -> tuple[Word, ...]:
    """Return free postures of an arm, on a grid of angles that can be called."""
    grid = list(product(*_FREE.values()))
    out = []
    for number, k in enumerate(sorted(rng.choice(len(grid), 8, replace=False)), start=1):
        angles = tuple((joint, float(np.radians(angle))) for joint, angle in zip(_FREE, grid[k], strict=True))
        out.append(Word(f"free_{number}", _FREE_ARM, angles, f"free_{number}"))
    return tuple(out)


def own_joint(part: str, joint: str) -> str:
    """Return the joint of a word's angle: ``right_arm``, ``shoulder_flexion`` -> ``right_shoulder_flexion``."""
    side = part.partition("_")[0]
    return f"{side}_{joint}" if side in SIDES else joint


def _fitted(body: Body, plan: Plan, part: str, word: Word) -> Word | None:
    """Return the word as this body and the plan's limits ask; None where too little of it is left."""
    if part == "legs":
        return word
    if _short_of(body, plan, part, word):
        return None
    named, within = dict(word.angles), _within(body, plan, part, word)
    if not word.rest and any(abs(within[joint] - angle) > _CUT for joint, angle in named.items()):
        name = f"{word.text}, {IN_PART}"
        word = replace(word, key=f"{word.key}_in_part", text=name, mirror=f"{word.mirror}_in_part")
    return replace(word, angles=tuple((joint, angle) for joint, angle in within.items() if angle or joint in named))


def _within(body: Body, plan: Plan, part: str, word: Word) -> dict[str, float]:
    """Return the angles of all joints of a part, as near to a word as ranges and limits let them be."""
    side, _, group = part.rpartition("_")
    names = (joint.name for joint in body.joints)
    own = (name.removeprefix(f"{side}_") for name in names if not side or name.startswith(f"{side}_"))
    # what a word does not name is straight, as far as it goes
    angles = dict.fromkeys((name for name in own if name.startswith(_JOINTS[group])), 0.0) | dict(word.angles)
    near = {own_joint(part, joint): _near(body, part, joint, angle) for joint, angle in angles.items()}
    for limit in plan.limits:
        near = limit.eased(near)
    return {joint: near[own_joint(part, joint)] for joint in angles}


def _short_of(body: Body, plan: Plan, part: str, word: Word) -> str:
    """Return the joint whose range leaves too little of a word, or the limb that may not go so far, "" if none does."""
    if part == "legs" or word.rest:
        return ""
    most = max((abs(angle) for joint, angle in word.angles if joint not in _PELVIS), default=0.0)

    def too_little(left: float, angle: float) -> bool:
        """Of what the word is about half must be left: whoever cannot turn is not asked to twist."""
        return abs(left - angle) > (min(_FITS, most / 2) if abs(angle) == most else _FITS)

    for joint, angle in word.angles:
        if too_little(_near(body, part, joint, angle), angle):
            return own_joint(part, joint)
    within = _within(body, plan, part, word)
    return f"{part} as it may be lifted" if any(too_little(within[j], angle) for j, angle in word.angles) else ""


def _near(body: Body, part: str, joint: str, angle: float) -> float:
    """Return the angle of a word within the range of this body's joint; the pelvis' own are free."""
    if joint in _PELVIS:
        return angle
    j = body.joint_index(own_joint(part, joint))
    low, high = body.limits.lower[j] + _STOP, body.limits.upper[j] - _STOP
    return float(np.clip(angle, min(low, high), max(low, high)))


def singular(text: str) -> str:
    """Return a word's text with the one limb that it is said of."""
    for limb in ("arm", "forearm", "elbow", "leg", "thigh"):
        text = text.replace(f"{limb}s ", f"{limb} ", 1)
    return text


_ROUNDS = 5  # Corrections of the pelvis; each leaves about a fifth of the error
_BACK = 0.03  # m behind the middle of a sole where people stand: over the arch
_DEEP, _EDGE = 0.04, 0.003
"""m inside the base of the foot over which the weight is led before the other one lifts: imprecise people need 15 mm
and four deviations of 6 mm; m left in the reduced base of both feet.
"""
_FROM_STOP = float(np.radians(3.0))  # rad that the joints of a holding arm keep from their stops
_TURN, _LEAN, _TILT = ROOT - 3, ROOT - 2, ROOT - 1
"""Coordinates of the pelvis' turn to the left, of its lean to the right, and of its tilt backward."""


@dataclass(frozen=True, eq=False)
class PostureTable:
    """Postures ``x`` (S, n) on the feet of ``stance``; with ``words`` of every part of the body posture s has the words
    ``index[s]`` (S, parts), optimised ones have none.
    """

    chain: Chain
    stance: Stance
    x: Array
    words: Vocabulary = field(default_factory=dict)
    index: NDArray[np.intp] = field(default_factory=lambda: np.empty((0, 0), dtype=np.intp))

    @classmethod
    def of(cls, chain: Chain, stance: Stance, words: Vocabulary) -> "PostureTable":
        """Return all combinations of ``words`` on the feet ``stance``."""
        index = np.array(list(product(*(range(len(group)) for group in words.values()))), dtype=np.intp)
        return cls(chain, stance, posed(chain, stance, words, index), words, index)

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

    @cached_property
    def standing(self) -> Array:
        """(S, 6, 10 N) regressors of standing still."""
        return standing_regressors(self.chain, self.x)

    def words_of(self, s: int) -> dict[str, Word]:
        """Return the word of every part of posture ``s``."""
        return {part: self.words[part][k] for part, k in zip(self.parts, self.index[s], strict=True)}

    def name_of(self, s: int) -> str:
        """Return the words of all parts that do not rest in posture ``s``; of arms that do the same, once."""
        if not self.words:
            return ""
        out, said = list[str](), self.words_of(s)
        for part, word in said.items():
            if not part.endswith(("_arm", "_hanging")) and (not word.rest or part.endswith("_lifted")):
                out.append(word.text)
        for kind in ("arm", "hanging"):
            out += _pair_words([word for part, word in said.items() if part.endswith(f"_{kind}")])
        return ", ".join(out) or ("sit" if self.stance.seat else "stand")

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


def _pair_words(pair: list[Word]) -> list[str]:
    """Return what the ``right`` and the left limb do, together where it is the same."""
    if not pair or all(word.rest for word in pair):
        return []
    if pair[0].key == pair[1].key:
        return [pair[0].text.format("both")]
    sides = zip(("the right", "the left"), pair, strict=True)
    return [singular(word.text.format(side)) for side, word in sides if not word.rest]


def posed(chain: Chain, stance: Stance, words: Vocabulary, index: NDArray[np.intp]) -> Array:
    """Return the coordinates (S, n) of the postures with the words ``index`` (S, parts)."""
    x, knee = np.zeros((len(index), chain.size)), np.zeros(len(index))
    names = {joint.name: ROOT + j for j, joint in enumerate(chain.body.joints)}
    for column, (part, group) in enumerate(words.items()):
        for k, word in enumerate(group):
            # Rows of postures with this word of this part.
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
    for _ in range(2 if stance.holding else 0):
        x = _gripping(chain, stance, settled(chain, stance, x, knee))
    return settled(chain, stance, x, knee)


def _gripping(chain: Chain, stance: Stance, x: Array) -> Array:
    """Return ``x`` (S, n) with holding arms bent by least squares, so that the palms come to their grips."""
    x, limits = x.copy(), chain.body.limits
    for side in stance.holding:
        segment, local = palm(chain.body, SIDES[side])
        arm = chain.arm_columns[side]
        low, high = limits.lower[np.array(arm) - ROOT] + _FROM_STOP, limits.upper[np.array(arm) - ROOT] - _FROM_STOP
        for _ in range(12):
            place, slope = State(chain, stance, x, *np.zeros((2, *x.shape))).points([segment], local[None])
            # Away from the present angles towards the elbow's.
            # of shoulder flexion, adduction, rotation, elbow flexion: away from the trunk
            J, out = slope[:, 0][:, :, arm], np.radians([0.0, -60.0, 40.0, 60.0]) - x[:, arm]
            # Damped pseudoinverse J'(J J' + d 1)^-1.
            inverse = np.swapaxes(J, 1, 2) @ np.linalg.inv(J @ np.swapaxes(J, 1, 2) + 1e-3 * np.eye(3))
            # out + J^+ (e - J out) = J^+ e + (1 - J^+ J) out: `out` acts in the null space of the palm's place.
            left = stance.hands[side] - place[:, 0] - np.einsum("sij,sj->si", J, out)
            step = np.einsum("sij,sj->si", inverse, left) + out
            x[:, arm] = np.clip(x[:, arm] + step, np.minimum(low, high), np.maximum(low, high))
    return x


def settled(chain: Chain, stance: Stance, x: Array, knee: Array) -> Array:
    """Return coordinates ``x`` (S, n) with the pelvis over the middle of the support and the planted ``knee`` (S,) rad
    bent; of a person on a stool on the seat.
    """
    x = x.copy()
    if stance.seat:
        x[:, 2] = stance.seat
        return x
    x[:, :2] = middle = _stood_over(stance)
    for _ in range(_ROUNDS):
        # The lower of both: no planted leg is longer than it can be.
        x[:, 2] = chain.root_heights(x, stance.ankle, knee, stance.planted).min(axis=0)
        x = chain.plant(x, stance.planted, stance.ankle)
        # Moving the pelvis moves nearly all of the body with it.
        x[:, :2] += middle - chain.mass_centre(x)[:, :2]
    x[:, 2] = chain.root_heights(x, stance.ankle, knee, stance.planted).min(axis=0)
    return chain.plant(x, stance.planted, stance.ankle)


def _stood_over(stance: Stance) -> Array:
    """Return the point (2,) m over which people stand: a little behind the middle of both feet; over that of one foot
    alone, as it is narrow at the heel; with the weight over one of two feet the nearest to the other one that is deep
    enough.
    """
    if stance.over is None:
        return stance.centre - np.array([_BACK if len(stance.planted) == 2 else 0.0, 0.0])
    one, both = stance.on(stance.over), stance.on(*stance.planted)
    aside = np.linspace(both.centre[1], one.centre[1], 200)
    points = np.column_stack([np.full(len(aside), one.centre[0] - _BACK), aside])
    (own, at), (normals, offsets) = one.reduced(1.0), both.reduced(stance.share)
    deep = np.minimum((points @ own.T + at).min(axis=1), _DEEP)
    left = (points @ normals.T + offsets).min(axis=1)
    # The first of the deepest.
    return np.asarray(points[np.argmax(np.where(left >= _EDGE, deep, -np.inf))])


def nearest_in_words(table: PostureTable, limits: tuple[Limit, ...]) -> str:
    """Return what forbids every posture of a table: the ``limits`` that the posture nearest to them breaks, joint and
    number, and how much more would do.
    """
    short = _short(table, limits)
    s = int(np.maximum(short, 0.0).sum(axis=0).argmin())
    broken = _broken(table, s, limits, short[:, s])
    if not broken:
        limit = table.keeps(s, limits)[1].replace("_", " ")
        return f"imprecise people leave too little of the limit on {limit} in all of them"
    return f"the one nearest to all limits breaks that on {broken}"


def words_never_kept(table: PostureTable, limits: tuple[Limit, ...]) -> tuple[str, ...]:
    """Return a sentence for every word that no posture of a table can have, with what the nearest one would break."""
    short, out = _short(table, limits), []
    worst = np.maximum(short, 0.0).sum(axis=0)
    for column, (part, words) in enumerate(table.words.items()):
        for k, word in enumerate(words[1:], start=1):
            rows = np.flatnonzero(table.index[:, column] == k)
            if (worst[rows] > 0).all():
                s = int(rows[worst[rows].argmin()])
                text = singular(word.text.format(f"the {part.partition('_')[0]}"))
                out.append(f"Left out: {text}; it would break the limit on {_broken(table, s, limits, short[:, s])}.")
    return tuple(out)


def _short(table: PostureTable, limits: tuple[Limit, ...]) -> Array:
    """Return what every posture lacks of each limit at rest, (limits, S) in their scale, at most 0 where it is kept."""
    rest = np.zeros_like(table.x)
    state, rows = State(table.chain, table.stance, table.x, rest, rest, sloped=False), list[Array]()
    for limit in (limit for limit in limits if limit.at_rest):
        reserve = limit.straight_reserve(table.stance)
        # In scales of the limit: what is lacking of the reserve.
        rows.append(reserve - limit.margins(state).value.min(axis=1, initial=np.inf) / limit.scale)
    return np.array(rows)


def _broken(table: PostureTable, s: int, limits: tuple[Limit, ...], short: Array) -> str:
    """Return in words which limits posture ``s`` of a table breaks, where and by how much."""
    asked, rest = [limit for limit in limits if limit.at_rest], np.zeros((1, table.chain.size))
    held = State(table.chain, table.stance, table.x[s : s + 1], rest, rest, sloped=False)
    return " and that on ".join(describe(held, limit) for limit, lack in zip(asked, short, strict=True) if lack > 0)
