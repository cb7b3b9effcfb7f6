"""Checks that run before any statistics: a cause that a look at the recording settles is named here, and never
fitted. Below what several checks share: what readers decided against the files or left out, and what markers do that
nobody can.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, TypeVar, cast

from biodance.effects._base.case import Case
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.markers.signals import FaultyMarker, MarkerFault, faulty_markers
from biodance.motion.contact import Contact
from biodance.motion.newton import LagAndMass, newton_of
from biodance.records import Defect, Markers, Session, Subject, Trial


@dataclass(frozen=True)
class Quantity:
    """One thing about a plate that is followed over time.

    Parameters
    ----------
    name, unit : str
        ``place_x`` and its unit.
    effect, target : str
        Name in `biodance.effects` of the cause of a wrong value, and where on the plate.
    typical : float
        Usual standard deviation from visit to visit in a laboratory without fault: where an archive of few visits
        starts from.
    matters : float
        Smaller changes are listed, but are no finding.
    share : float
        Of the alarms that chance may raise: more where evidence is thin.
    norm : float
        Standard deviation of what is expected of a plate without fault, the same in all visits of a laboratory (where
        it puts its toe marker): it blurs the level, not a change.
    """

    name: str
    unit: str
    effect: str
    target: str
    typical: float
    matters: float
    share: float
    norm: float = 0.0

    def __post_init__(self) -> None:
        if self.typical <= 0:
            raise ValueError(f"Quantity {self.name}: typical = {self.typical} must be positive.")


@dataclass(frozen=True)
class QualityCheck:
    """One check: ``check`` what was looked at, ``ok``, ``text`` one plain sentence of what was seen; where it is not
    well the cause: ``effect`` and ``target`` as in the family, and the ``size`` of its ``quantity`` in ``unit`` (NaN =
    no number) with its standard deviation ``sd``; ``trials`` in which it is (() = all); ``alike`` the effects and
    targets that it cannot be told from; ``advice`` how the effect is mended (filled in by `check_quality`); ``mended``
    where it was taken out before anything was judged, so that the rest can be.
    """

    check: str
    ok: bool
    text: str
    effect: str = ""
    target: str = ""
    size: float = float("nan")
    quantity: str = "size"
    unit: str = ""
    advice: str = ""
    mended: bool = False
    sd: float = float("nan")
    trials: tuple[str, ...] = ()
    alike: tuple[tuple[str, str], ...] = ()

    def meant(self, trial: Trial) -> bool:
        """Return whether its cause is in a trial."""
        return not self.trials or trial.name in self.trials


_Found = TypeVar("_Found")


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the checks look at: the ``session`` as read, the tracked ``cases`` with measured frames (none where no body
    could be scaled), and the ground ``contacts`` of all tracked trials by name.
    """

    session: Session
    cases: tuple[Case, ...] = ()
    contacts: Mapping[str, Contact] = field(default_factory=dict)

    @cached_property
    def newton(self) -> Mapping[str, LagAndMass]:
        """What Newton tells of every trial with forces and a trunk, by name."""
        subject = self.session.subject
        mass = float("nan") if "mass" in subject.guessed else subject.mass
        told = {trial.name: newton_of(trial, mass=mass) for trial in self.session.trials if trial.plates}
        return {name: one for name, one in told.items() if one is not None}

    def once(self, look: "Callable[[Recorded], _Found]") -> "_Found":
        """Return what a ``look`` at this finds, looked at once however often it is asked for."""
        if look not in self._found:
            self._found[look] = look(self)
        return cast("_Found", self._found[look])

    @cached_property
    def _found(self) -> dict[object, object]:
        return {}


class Checked:
    """A cause of either kind, as a look at the recordings before any statistics finds it. What is so large that gates
    would throw away the very frames that show it is found here, and undone in a copy before all else is judged.

    All that is known of a cause stands in its own file: what is not said there is as below.
    """

    name: ClassVar[str] = ""
    separated_by: ClassVar[str] = ""
    """The movement or measurement that settles it or tells it from its look-alikes, in words for the analyst."""
    advice: ClassVar[str] = ""
    """What to do in the laboratory to settle it, and how it is mended."""
    about: ClassVar[About] = About()
    words: ClassVar[CauseWords | None] = None
    """How a person is told of it; None: by its name and its advice."""
    explains: ClassVar[tuple[CheckKind, ...]] = ()
    """Checks outside their limits that may come from it; one of weight adds or takes weight, as a load does."""
    raw: ClassVar[bool] = False
    """Whether it spoils the raw channels: what feet, clocks and weights measure in such recordings has no size."""
    followed: ClassVar[tuple[Quantity, ...]] = ()
    """What is followed of it from visit to visit in an archive."""
    habit: ClassVar[bool] = False
    """Whether it is no fault of an instrument: told as a finding, and nothing is wrong with it alone."""

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the checks that could be made on the recording; by default none."""
        return ()

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return a trial as read without what its check ``found`` in it; by default as it is: nobody can undo it."""
        return trial

    @classmethod
    def declared(cls, subject: Subject, target: str) -> Subject:
        """Return the person as declared once this cause at ``target`` is accepted: by default the same."""
        return subject

    @classmethod
    def of_person(cls) -> bool:
        """Return whether it is declared of the person, not taken off the recordings."""
        return cls.declared.__func__ is not Checked.declared.__func__  # type: ignore[attr-defined]

    @classmethod
    def undoes(cls) -> bool:
        """Return whether it is undone before all else is judged."""
        return cls.undone.__func__ is not Checked.undone.__func__  # type: ignore[attr-defined]


class DiscreteEffect(Checked, ABC):
    """One cause that is there or not; the checks that find it are its ``check``, and a file without it is refused
    when it is found.
    """

    @classmethod
    @abstractmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the checks that could be made on the recording."""


def unit_of(target: str) -> str:
    """Return the unit of the channel that a target names last: N or N·m."""
    return "N·m" if target.rpartition(":")[2].startswith("M") else "N"


def unit_at(unit: str, target: str) -> str:
    """Return a parameter's ``unit`` at a target, where it is another one at each (``N or N·m``)."""
    if " or " not in unit:
        return unit
    source, arrow, channel = target.rpartition("->")
    if not arrow:
        return unit_of(target)
    first, second = unit_of(source), unit_of(channel)
    return "1" if first == second else "m" if first == "N" else "1/m"


def overruled_files(session: Session, patterns: dict[str, str], *, check: str, effect: str) -> tuple[QualityCheck, ...]:
    """Return a failed ``check`` for each target, or each size of it, on which the reader decided against the files,
    with ``effect`` as its cause; of several trials, which name their own numbers, the first tells.

    ``patterns`` are regular expressions by what they speak of (``corners``); a group in the expression is the number.
    The target is the plate's name and what, or only what.
    """
    first: dict[tuple[str, str], str] = {}
    for trial in session.trials:
        said = [("", sentence) for sentence in (*trial.history, *trial.warnings)]
        said += [(plate.name, sentence) for plate in trial.plates for sentence in plate.decisions]
        for where, sentence in said:
            plate = re.match(r"Plate (\d+)", sentence)
            place = where or (f"plate{plate[1]}" if plate else "")
            for what, pattern in patterns.items():
                if match := re.search(pattern, sentence):
                    number = match[1] if match.groups() else ""
                    first.setdefault((f"{place}:{what}" if place else what, number), sentence)
    return tuple(
        QualityCheck(check, False, sentence, effect, target, float(number) if number else float("nan"))
        for (target, number), sentence in first.items()
    )


def checks_of_defects(session: Session, effect: str, *, check: str, quantity: str) -> tuple[QualityCheck, ...]:
    """Return a failed ``check`` for every target at which readers left something out because of ``effect``: what was
    seen in its first trial, and in which trials it is. None where nothing was left out.
    """
    first: dict[str, Defect] = {}
    trials: dict[str, list[str]] = {}
    for trial in session.trials:
        for one in trial.defects:
            if one.effect == effect:
                first.setdefault(one.target, one)
                trials.setdefault(one.target, []).append(trial.name)
    found = []
    for target, one in first.items():
        text = f"{one.text} ({', '.join(trials[target])})"
        found.append(QualityCheck(check, False, text, effect, target, one.size, quantity, one.unit, mended=True))
    return tuple(found)


def marker_checks(recorded: Recorded, fault: MarkerFault, effect: str) -> tuple[QualityCheck, ...]:
    """Return a failed check for each marker with this ``fault``, with the trials and seconds, or one that says none
    has it. Preparing a trial takes these frames out (`prepare`), so the rest is judged.
    """
    found: dict[str, list[tuple[FaultyMarker, str]]] = {}
    for trial, markers, faults in (trials := recorded.once(_faulty)):
        for one in faults:
            if one.fault is fault:
                found.setdefault(one.label, []).append((one, f"{trial.name} {one.when(markers.time)}"))
    check = f"{fault.value} markers"
    if not found:
        return (QualityCheck(check, True, f"No marker shows a {fault.value} frame."),) if trials else ()
    checks = []
    for label, places in found.items():
        largest = replace(places[0][0], size=max(one.size for one, _ in places))
        text = largest.sentence("; ".join(where for _, where in places))
        checks.append(QualityCheck(check, False, text, effect, label, mended=True))
    return tuple(checks)


def _faulty(recorded: Recorded) -> list[tuple[Trial, Markers, tuple[FaultyMarker, ...]]]:
    """Return the trials that have markers, with those of its set (all without one) and their faults of every kind."""
    found = []
    for trial in recorded.session.trials:
        if (markers := trial.markers) is not None:
            worn = canonical(markers, read_marker_set(trial.marker_set)) if trial.marker_set else markers
            found.append((trial, worn, faulty_markers(worn)))
    return found
