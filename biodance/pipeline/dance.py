"""A dance for a person or robot, step by step, with its margins, what it tells, and what others see of it."""

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.skeleton import joint_limits
from biodance.body.similarity import standing_frames
from biodance.body.urdf import read_urdf
from biodance.dance.cues import Number, Say, as_number, in_english
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.expectation import Expectation, expect
from biodance.dance.limits import ForImprecise, Limit, Margin, family
from biodance.dance.performers import OF_PERFORMERS, PERFORMER_COUNT, for_imprecise
from biodance.dance.problem.feet import AROUND, room_on_plates
from biodance.dance.problem.person import PersonLimits, fit_to_person, limit_body
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.shapes import pairs_of
from biodance.dance.problem.stance import SEAT_TO_HIP
from biodance.dance.robot import design_robot, robot_plan
from biodance.dance.search.postures import counterpart
from biodance.dance.search.word_course import NoNextPosture, freer_dance
from biodance.dance.verify import DanceMetrics, broken, dance_metrics, longest_alone
from biodance.display import cause_in_words
from biodance.errors import BiodanceError
from biodance.lab.c3d.write import FileValue
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Markers, Motion, Session, Subject
from biodance.threads import one_thread

if TYPE_CHECKING:
    from biodance.inference.foresight import Foresight


_BEYOND = np.radians(3.1)  # rad that joints go beyond a limit in a person's file of which nobody need decide
_FAR, _NEW = 3.0, 0.9
"""Times its bound at which the static criterion is warned of; share of the table's standard deviation that is left of
what is not learned.
"""


@dataclass(frozen=True, eq=False)
class DanceResult:
    """What came of designing a dance.

    Parameters
    ----------
    body : Body
        As fitted to the person.
    plan : Plan
        The protocol, as fitted to the person.
    dance : Dance or None
        None where none keeps all limits.
    margins : tuple
        Worst of every limit, judged by other code than the optimiser's.
    account, expectation : Account, Expectation or None
        What the dance tells, and what will be known after it; None without a dance.
    reason : str
        Which limit forbids the dance; "" with one.
    notes : tuple of str
        What was left out for the person (``dance.notes``: because a move was impossible).
    seconds : float
        Of computing.
    reason_of_person : str
        Why the person's file asks for limits of their own; "" without one.
    freely : Expectation or None
        What would be known after as many of the same postures chosen freely (`freer_dance`): the price of a dance that
        can be followed; None where nothing limits the choice.
    widened : bool
        Whether a limit of the person's own is not kept, as nobody can do without what it forbids (``notes``).

    Examples
    --------
    >>> made = biodance.design_dance(biodance.Subject(65.0, 1.75, "F"), "one_segment")  # doctest: +SKIP
    >>> made.feasible  # doctest: +SKIP
    True
    """

    body: Body
    plan: Plan
    dance: Dance | None
    margins: tuple[Margin, ...]
    account: DanceMetrics | None
    expectation: Expectation | None
    reason: str
    notes: tuple[str, ...]
    seconds: float
    reason_of_person: str = ""
    freely: Expectation | None = None
    widened: bool = False

    def __repr__(self) -> str:
        return f"DanceResult({self.dance!r})" if self.dance is not None else f"DanceResult(no dance: {self.reason})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.dance.table() if self.dance is not None else None, self.notes)

    @property
    def feasible(self) -> bool:
        """True where there is a dance and every margin of it is kept."""
        return self.dance is not None

    @property
    def performers(self) -> dict[str, float] | None:
        """What imprecise performers leave of every limit that they must keep, m; None where none were asked."""
        found = {one.key: worst for one, worst in self._left}
        return {"count": PERFORMER_COUNT, **found} if found else None

    @property
    def _left(self) -> list[tuple[ForImprecise, float]]:
        worst = {margin.limit: margin.worst for margin in self.margins}
        asked = {f"{limit.name}_{OF_PERFORMERS}": one for limit, one in for_imprecise(self.plan.limits).items()}
        return [(one, worst[name] + one.least) for name, one in asked.items() if name in worst]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is not safe in this dance, and what it cannot tell, as its criterion is far from its bound."""
        unsafe = not_safe(self.dance) if self.dance else ()
        if self.account is None or self.expectation is None or self.account.static <= _FAR * self.account.static_bound:
            return unsafe
        ratio = self.account.static / self.account.static_bound
        hardly = f" Hardly tilted: {_names(self.account.hardly)}." if self.account.hardly else ""
        known, poor = self.expectation, []  # what stays nearly as uncertain as in the table
        for what, sd in (("mass", known.mass), ("centre of mass", known.com)):
            names = [name for name, left in zip(known.segments, sd[-1] / sd[0], strict=True) if left > _NEW]
            poor += [f"the {what} of {_names(names)}"] * bool(names)
        taught = (
            f"It cannot teach {' and '.join(poor)}: the table alone tells."
            if poor
            else "Every segment is learned in part."
        )
        return (*unsafe, f"The static criterion is {ratio:.1f} times its bound.{hardly} {taught}")

    @property
    def price(self) -> str:
        """What it costs that the dance can be followed, in a sentence; "" where nothing limits the choice."""
        if self.expectation is None or self.freely is None:
            return ""
        here, free = (
            f"{np.sqrt(np.mean(one.mass[-1] ** 2)):.2f} kg, {1000 * np.sqrt(np.mean(one.com[-1] ** 2)):.1f} mm"
            for one in (self.expectation, self.freely)
        )
        return (
            f"Expected standard deviations of masses and centres of mass after it: {here}; if the same postures were "
            f"chosen freely, with any number of instructions at once: {free}."
        )

    @property
    def emphasis(self) -> tuple[str, ...]:
        """How well masses become known of segments with an emphasis and of their counterparts, in sentences."""
        known, out = self.expectation, list[str]()
        for name, factor in self.plan.weights if known is not None else ():
            if known is None or factor <= self.plan.other_weight or counterpart(name) == name:
                continue
            here, there = (known.segments.index(one) for one in (name, counterpart(name)))
            before, after = known.mass[0], known.mass[-1]
            said = (
                f"Emphasis on the {_names((name,))}: its mass becomes known to {after[here]:.2f} kg (table: "
                f"{before[here]:.2f}), that of the {_names((counterpart(name),))} to {after[there]:.2f}."
            )
            covariance = self.body.sip.covariance  # of [m, mc, I] by segment: every tenth row is a mass
            i, j = 10 * here, 10 * there
            alike = covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j])
            # left of the table's sd on the other side, too: the emphasis taught both through their correlation
            if after[there] / before[there] < 1.1 * after[here] / before[here]:
                said += f" Both, because a person's sides are alike (correlation in the table {alike:.2f})."
            out.append(said)
        return tuple(out)

    @property
    def left_out(self) -> tuple[str, ...]:
        """What was left out or corrected for this person, or because a move was impossible, in sentences."""
        return (*self.notes, *(self.dance.notes if self.dance else ()))

    @property
    def settled(self) -> bool:
        """True where nobody has to decide anything: there is a dance, imprecise people are safe in it, and no limit of
        the person's own was widened.
        """
        return self.feasible and not self.widened and not broken(self.margins)


def before_cues(result: DanceResult, say: Say = in_english, number: Number = as_number) -> tuple[str, ...]:
    """Return what stands before the cues in the language of ``say``: for whom, whose limits, how safe."""
    out = [say("For %(whom)s.", whom=say(result.plan.whom))] if result.plan.whom else []
    if result.dance and (alone := longest_alone(result.dance)):
        out.append(say("One foot is off the ground for up to %(seconds)s s at a time.", seconds=number(alone, 0)))
    if result.dance:
        out.append(plate_sentence(result.dance, say, number))
    if result.reason_of_person:
        out.append(say("Made for one person's limits: %(reason)s.", reason=result.reason_of_person))
    if found := result._left:
        kept = [
            say("%(size)s cm of %(what)s", size=number(100 * worst, 1), what=say(one.words)) for one, worst in found
        ]
        out.append(
            say(
                "Copied badly by %(count)s simulated people (seven degrees off in every joint, a fifth off in "
                "time, swaying), it keeps %(kept)s at the worst moment.",
                count=number(PERFORMER_COUNT, 0),
                kept=", ".join(kept),
            )
        )
    else:
        out.append(say("Nobody imprecise was tried on this dance: it is for trained people only."))
    return tuple(out)


def _names(segments: Iterable[str]) -> str:
    return ", ".join(map(display.spaced, segments))


def not_safe(dance: Dance, say: Say = in_english, number: Number = as_number) -> tuple[str, ...]:
    """Return what imprecise people lack in a dance, a sentence for each limit in the language of ``say``; none where
    it is safe.
    """
    words = {f"{limit.name}_{OF_PERFORMERS}": one.words for limit, one in for_imprecise(family()).items()}
    return tuple(
        say(
            "NOT SAFE when imprecise: %(size)s cm of the %(what)s that is needed are missing at %(second)s s "
            "(%(where)s) for the worst of %(count)s simulated people. Try another seed or an easier protocol.",
            size=number(-100 * m.worst, 1),
            what=say(words.get(m.limit, m.limit)),
            second=number(m.where_s, 0),
            where=say(display.spaced(m.what)),
            count=number(PERFORMER_COUNT, 0),
        )
        for m in dance.unsafe
    )


def plate_sentence(dance: Dance, say: Say = in_english, number: Number = as_number) -> str:
    """Return how much force plate a dance needs, and for which it was made, in the language of ``say``."""
    wide, ahead = (number(one, 2) for one in room_on_plates(dance.stances))
    room = {"wide": wide, "ahead": ahead, "around": number(100 * AROUND, 1)}
    if high := max(stance.seat for stance in dance.stances):
        said = say(
            "The seat is %(high)s m high, so that the feet hang. The stool's legs need %(wide)s m of force plate from "
            "side to side and %(ahead)s m ahead; mark their outlines.",
            high=number(high - SEAT_TO_HIP, 2),
            **room,
        )
    elif any(np.isfinite(stance.hands).any() for stance in dance.stances):
        said = say(
            "The feet need %(wide)s m of force plate from side to side and %(ahead)s m ahead, %(around)s cm around "
            "them included, and the legs of the frame stand on plates, too; mark their outlines.",
            **room,
        )
    else:
        said = say(
            "The feet need %(wide)s m of force plate from side to side and %(ahead)s m ahead, %(around)s cm around "
            "them included; mark their outlines.",
            **room,
        )
    if dance.plate is None:
        return said
    wide, ahead = (number(one, 2) for one in dance.plate)
    made = say("It is made for a plate of %(wide)s m by %(ahead)s m (--plate).", wide=wide, ahead=ahead)
    return f"{said} {made}"


def plates_too_small(dance: Dance, session: Session) -> str:
    """Return a sentence where a session's plates together cannot carry all feet of a dance; else ""."""
    fits = [trial for trial in session if trial.role == "fit"]
    corners = [plate.corners[:, :2] for trial in fits for plate in trial.plates if plate.placed]
    if not corners:
        return ""
    side = corners[0][1] - corners[0][0]
    along = side / np.linalg.norm(side)
    points = np.concatenate(corners)
    size = np.ptp(points @ np.column_stack([along, [-along[1], along[0]]]), axis=0)
    room = room_on_plates(dance.stances)
    # m by which sides of plates differ from what is written of them
    if any(np.all(room <= one + 0.001) for one in (size, size[::-1])):
        return ""
    return (
        f"{plate_sentence(dance)} The plates of {session.folder} cover {size[0]:.2f} m by {size[1]:.2f} m, and frames "
        f"in which a foot may stand beside them are left out. Design the dance for these plates (biodance dance "
        f"--plate), or use larger ones."
    )


TRIAL_SECONDS = 20.0
"""s: a designed dance is looked at as trials of about this length."""


def foresee_dance(path: Path) -> tuple["Foresight", Dance, Expectation | None]:
    """Return what the dance in a file of `biodance dance` will be able to see, as trials of about `TRIAL_SECONDS`, the
    dance, and what it teaches of a person's masses (None of a robot's). Raises FileRefused: the file is no dance.
    """
    from biodance.inference.foresight import foresee, session_of

    dance = Dance.load(path)
    known = expect(dance, steps=1) if dance.body.markers.names else None
    return foresee(dance.body, session_of(dance.motion(50.0), TRIAL_SECONDS)), dance, known


_Tell = Callable[[str, int, int], None]
"""Told what is being done, how many parts are finished and of how many (0: not counted)."""
UNFINISHED = "unfinished"
"""Folder with what is finished of a dance whose design was stopped."""
_OURS = (
    *("results.json", "dance.npz", "dance.c3d", "dance.csv", "cues.md", "cues.html", "margins.md"),
    *("postures.png", "postures_3d.png", "criterion.png", "zmp.png", "expectation.png"),
)
"""Files that a dance consists of."""


_LEGAL = {"mass": (30.0, 200.0, "kg"), "stature": (1.2, 2.2, "m")}


def dancer(subject: Subject, plan: Plan) -> Body:
    """Return the body of a person for whom a dance is designed: a generic one, joints within the ranges that the plan
    names. Raises BiodanceError: mass or stature are outside the range of the tables.
    """
    for name, (low, high, unit) in _LEGAL.items():
        value = getattr(subject, name)
        if not low <= value <= high:
            raise BiodanceError(
                f"The {name} is {value:g} {unit}; a dance is designed for {low:g} to {high:g} {unit}. Correct it."
            )
    return replace(human(subject), limits=joint_limits(subject, within=plan.ranges))


@one_thread()
def make_dance(
    body: Body,
    plan: Plan,
    person: PersonLimits,
    *,
    subject: Subject | None,
    limits: Iterable[Limit | type[Limit]] = (),
    seed: int = 0,
    tell: _Tell = lambda *_: None,
    resume: Path | None = None,
) -> DanceResult:
    """Design, check and count a dance of ``plan`` for the ``body`` of a ``subject`` (`dancer`), or of a robot (None;
    `robot_dancer`), with the limits of ``person``; ``resume`` keeps what is finished meanwhile.

    ``limits`` are kept beside those of the plan, or in place of one of the same name (`dance.limits`).

    Raises
    ------
    BiodanceError
        The protocol and the person contradict each other (`fit_to_person`), or it is not one for robots.
    """
    started, robot = time.perf_counter(), subject is None
    plan = robot_plan(body, plan) if robot else plan
    own, plan, notes = fit_to_person(body, plan.with_limits(limits), person)
    asked = limit_body(body, person)
    beyond = max(np.max(asked.lower - own.limits.lower), np.max(own.limits.upper - asked.upper))
    widened = bool(beyond > _BEYOND or 0 < person.seat_height < plan.seat_height)
    if robot:
        coarse = pairs_of(body).unchecked
        boxes = f"Not kept apart, since their boxes overlap at zero angles: {', '.join(coarse)}."
        notes = (*body.notes, *([boxes] if coarse else []), *notes)
    reason, margins, dance = "", tuple[Margin, ...](), None
    try:
        dance, margins = (design_robot if robot else design)(own, plan, seed=seed, tell=tell, resume=resume)
    except BiodanceError as error:
        reason = str(error)
    counted = expected = freely = None
    if dance is not None:
        rest = plan.rest if np.isfinite(plan.rest) else None
        dance = replace(dance, plate=plan.plate, subject=subject, care=plan.care, rest=rest)
        tell("counting what the dance tells", 0, 0)
        # minutes of work that share nothing: two of the three counts run beside, in a process of their own
        with ProcessPoolExecutor(1) as aside:
            numbers = aside.submit(dance_metrics, dance, plan)
            free = aside.submit(_freer_expectation, dance, plan)
            expected, counted, freely = expect(dance), numbers.result(), free.result()
        reason = " ".join(
            f"The limit on {cause_in_words(m.limit, m.what)} is broken by {-m.worst:.3g} {m.unit} at {m.where_s:.2f} s."
            for m in broken(margins)
            if not m.limit.endswith(OF_PERFORMERS)
        )
    if reason:
        dance = counted = expected = freely = None
    spent = time.perf_counter() - started
    known = counted, expected, reason, notes, spent, person.reason, freely
    return DanceResult(own, plan, dance, margins, *known, widened)


def _freer_expectation(dance: Dance, plan: Plan) -> Expectation | None:
    """Return what as many postures on the same feet would tell, chosen freely; None where they are."""
    if not np.isfinite(plan.instructions):
        return None
    try:
        return expect(freer_dance(dance.body, plan, seed=dance.seed, stances=dance.stances), steps=1)
    except NoNextPosture:
        return None


def dance_folder(out: Path, *, force: bool = False) -> Path:
    """Return the folder for a dance, made if missing; with ``force`` it may hold an earlier one.

    A folder that holds nothing but a stopped design is gone on with.

    Raises
    ------
    BiodanceError
        It is a file, holds files already and ``force`` was not given, or holds files that are not of a dance.
    """
    if out.exists() and not out.is_dir():
        raise BiodanceError(f"{out}: is a file; a dance needs a folder. Choose another --out.")
    out.mkdir(parents=True, exist_ok=True)
    found = sorted(path.name for path in out.iterdir() if path.name != UNFINISHED)
    foreign = [name for name in found if name not in _OURS]
    if foreign:
        raise BiodanceError(f"{out}: holds files that are not of a dance ({foreign[0]}). Choose another --out.")
    if found and not force:
        raise BiodanceError(
            f"{out}: holds a dance already and nothing is overwritten. Choose another --out, or --force."
        )
    return out


def robot_dancer(path: Path, feet: str, *, mend: bool = False) -> Body:
    """Return the robot of a URDF file, in standing frames; ``feet`` the links of its right and left foot, "right,left";
    ``mend`` as in `urdf.read_urdf`.

    Raises
    ------
    BiodanceError
        Not two feet are named, or the file cannot be used (`urdf.read_urdf`, `standing_frames`).
    """
    return standing_frames(read_urdf(path, feet=named_feet(feet), mend=mend))


def named_feet(feet: str) -> tuple[str, str]:
    """Return the links of the right and the left foot of "right,left"; BiodanceError if that is not two."""
    names = [name.strip() for name in feet.split(",")]
    if len(names) != 2 or names[0] == names[1] or not all(names):
        raise BiodanceError(f"--feet {feet}: expected the links of the right and the left foot, separated by a comma.")
    return names[0], names[1]


PREVIEW_RATE = 100.0
"""Hz of the preview's markers and of the table of joint angles."""


def held_postures(dance: Dance, chosen: Sequence[int] | None = None) -> Motion:
    """Return the postures of a dance (all, or those ``chosen`` by index) as a motion of one frame each, at rest."""
    numbers = range(len(dance.stances)) if chosen is None else chosen
    both = ((dance.postures[p], dance.stances[p]) for p in numbers)
    x = np.array([dance.chain.plant(row[None], stance.planted, stance.ankle)[0] for row, stance in both])
    return dance.chain.motion(np.arange(len(x), dtype=float), x, np.zeros_like(x), np.zeros_like(x))


def preview_markers(dance: Dance) -> Markers:
    """Return the dance as virtual markers at `PREVIEW_RATE`: what cameras see of a person who dances it exactly."""
    motion, markers = dance.motion(PREVIEW_RATE), dance.body.markers
    xyz = poses(dance.body, motion.q).points(list(markers.segment), markers.position)
    return Markers(markers.names, motion.time, xyz)


def preview_parameters(dance: Dance) -> dict[str, dict[str, FileValue]]:
    """Return what a C3D file says beside the markers: the mass (kg), events (postures by their number, feet that leave
    the ground or come back; times in minutes and seconds) and support phases (times in s).
    """
    found = [(phase.start, "General", f"Posture {phase.posture + 1}") for phase in dance.phases if phase.kind == "hold"]
    for before, after in pairwise(dance.phases):
        for side, name in enumerate(SIDES):
            down = [side in phase.stance.planted for phase in (before, after)]
            if down[0] != down[1]:
                found.append((after.start, name.capitalize(), "Foot Strike" if down[1] else "Foot Off"))
    time = np.array([one[0] for one in sorted(found)])
    contexts, labels = ([one[k] for one in sorted(found)] for k in (1, 2))
    # C3D: times of events are pairs of whole minutes and seconds
    minutes = np.stack([time // 60, time % 60])
    feet = [" and ".join(SIDES[side] for side in phase.stance.planted) or "stool" for phase in dance.phases]
    times = np.array([[phase.start, phase.end] for phase in dance.phases]).T
    return {
        "PROCESSING": {"Bodymass": float(dance.body.sip.mass.sum())},
        "SUBJECTS": {"NAMES": ["designed dance"]},
        "EVENT": {"USED": np.int16(len(found)), "CONTEXTS": contexts, "LABELS": labels, "TIMES": minutes},
        "DANCE": {"SUPPORT": feet, "SUPPORT_TIMES": times},
    }


def setpoints(dance: Dance) -> tuple[list[str], Array]:
    """Return headings and rows of a robot's dance: time (s), root (m, quaternion x y z w), angles (rad), z up."""
    motion = dance.motion(PREVIEW_RATE)
    names = ["time_s", *(f"root_{axis}_m" for axis in "xyz"), *(f"root_q{axis}" for axis in "xyzw")]
    return [*names, *(f"{joint.name}_rad" for joint in dance.body.joints)], np.column_stack([motion.time, motion.q])
