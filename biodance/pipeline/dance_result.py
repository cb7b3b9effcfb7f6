"""What came of designing a dance: the dance, its margins, what it tells, and the sentences that stand before it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.expectation import Expectation, expect
from biodance.dance.limits import ForImprecise, family
from biodance.dance.performers import OF_PERFORMERS, PERFORMER_COUNT, for_imprecise
from biodance.dance.problem.feet import room_in_words, room_on_plates
from biodance.dance.problem.plan import Plan
from biodance.dance.search.postures import counterpart
from biodance.dance.verify import DanceMetrics, Margin, broken, longest_alone
from biodance.records import Session

if TYPE_CHECKING:
    from biodance.diagnosis.foresight import Foresight

_AS_MUCH = 1.1
"""Times as much left of the table's standard deviation of a counterpart's mass: less is no effect of an emphasis."""
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
        """What must be known of this dance, in plain sentences: what is not safe, and what it cannot tell because the
        criterion is far from its bound.
        """
        unsafe = not_safe(self.dance) if self.dance else ()
        if self.account is None or self.expectation is None or self.account.static <= _FAR * self.account.static_bound:
            return unsafe
        ratio = self.account.static / self.account.static_bound
        hardly = f" Hardly tilted: {_names(self.account.hardly)}." if self.account.hardly else ""
        return (
            *unsafe,
            f"The static criterion is {ratio:.1f} times its bound.{hardly} {self._unlearned(self.expectation)}",
        )

    def _unlearned(self, known: Expectation) -> str:
        """Return what is not learned, in a sentence: what stays nearly as uncertain as in the table."""
        told = {"mass": known.mass, "centre of mass": known.com}
        poor = {
            what: tuple(name for name, ratio in zip(known.segments, sd[-1] / sd[0], strict=True) if ratio > _NEW)
            for what, sd in told.items()
        }
        said = " and ".join(f"the {what} of {_names(names)}" for what, names in poor.items() if names)
        return f"It cannot teach {said}: the table alone tells." if said else "Every segment is learned in part."

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
        """What came of the emphasis on segments, a sentence each: how well its mass will be known, how well that of its
        counterpart, and why both where one was asked for.
        """
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
            covariance = self.body.sip.covariance
            i, j = 10 * here, 10 * there
            alike = covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j])
            if after[there] / before[there] < _AS_MUCH * after[here] / before[here]:
                said += f" Both, because a person's sides are alike (correlation in the table {alike:.2f})."
            out.append(said)
        return tuple(out)

    @property
    def about(self) -> tuple[str, ...]:
        """What stands before the cues: for whom, the person's own limits and their reason, how safe, what was left
        out.
        """
        out = [f"For {self.plan.whom}."] if self.plan.whom else []
        if self.dance and (alone := longest_alone(self.dance)):
            out.append(f"One foot is off the ground for up to {alone:.0f} s at a time.")
        if self.dance:
            out.append(plate_sentence(self.dance))
        if self.reason_of_person:
            out.append(f"Made for one person's limits: {self.reason_of_person}.")
        if found := self._left:
            kept = ", ".join(f"{100 * worst:.1f} cm of {one.words}" for one, worst in found)
            out.append(
                f"Copied badly by {PERFORMER_COUNT} simulated people (seven degrees off in every joint, a fifth off in "
                f"time, swaying), it keeps {kept} at the worst moment."
            )
        else:
            out.append("Nobody imprecise was tried on this dance: it is for trained people only.")
        return (*out, *self.notes, *(self.dance.notes if self.dance else ()))

    @property
    def complete(self) -> bool:
        """True where nothing of the protocol was left out, neither for the person nor because a move was impossible,
        and imprecise people are safe.
        """
        counted = self.dance.counted.sum() if self.dance else 0
        return (
            not self.notes
            and not broken(self.margins)
            and (np.isfinite(self.plan.budget) or counted == self.plan.count)
        )


def _names(segments: tuple[str, ...]) -> str:
    return ", ".join(display.spaced(name) for name in segments)


def not_safe(dance: Dance) -> tuple[str, ...]:
    """Return what imprecise people lack in a dance, a sentence for each limit; none where it is safe."""
    words = {f"{limit.name}_{OF_PERFORMERS}": one.words for limit, one in for_imprecise(family()).items()}
    return tuple(
        f"NOT SAFE when imprecise: {-100 * m.worst:.1f} cm of the {words.get(m.limit, m.limit)} that is needed are "
        f"missing at {m.where_s:.0f} s ({display.spaced(m.what)}) for the worst of {PERFORMER_COUNT} simulated "
        f"people. Try another seed or an easier protocol."
        for m in dance.unsafe
    )


def plate_sentence(dance: Dance) -> str:
    """Return how much force plate a dance needs, and for which it was made."""
    seated = any(stance.seat for stance in dance.stances)
    needs = room_in_words(room_on_plates(dance.stances), seated=seated)
    frame = ", and the legs of the frame stand on plates, too" * any(np.isfinite(s.hands).any() for s in dance.stances)
    made = dance.plate and f" It is made for a plate of {dance.plate[0]:.2f} m by {dance.plate[1]:.2f} m (--plate)."
    return f"{needs[:1].upper()}{needs[1:]}{frame}; mark their outlines.{made or ''}"


_ALIKE = 0.001
"""m by which sides of plates differ from what is written of them."""


def plates_too_small(dance: Dance, session: Session) -> str:
    """Return a sentence where the plates of a ``session`` cannot carry all feet of a ``dance``, whichever way the
    person faces; "" where they can: several are taken for as large as what they enclose.
    """
    fits = [trial for trial in session if trial.role == "fit"]
    corners = [plate.corners[:, :2] for trial in fits for plate in trial.plates if plate.placed]
    if not corners:
        return ""
    side = corners[0][1] - corners[0][0]
    along = side / np.linalg.norm(side)
    points = np.concatenate(corners)
    size = np.ptp(points @ np.column_stack([along, [-along[1], along[0]]]), axis=0)
    room = room_on_plates(dance.stances)
    if any(np.all(room <= one + _ALIKE) for one in (size, size[::-1])):
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
    dance, and what it teaches of a person's masses (None of a robot's).

    Raises
    ------
    FileRefused
        The file is no dance.
    """
    from biodance.diagnosis.foresight import foresee, session_of

    dance = Dance.load(path)
    known = expect(dance, steps=1) if dance.body.markers.names else None
    return foresee(dance.body, session_of(dance.motion(50.0), TRIAL_SECONDS)), dance, known
