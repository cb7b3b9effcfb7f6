"""A channel of a force plate reads a constant factor too much."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Parameter
from biodance.effects._base.installed_plate import InstalledPlate
from biodance.effects._base.quality_check import QualityCheck, Quantity, Recorded
from biodance.effects._base.words import CALIBRATE, TOO_MUCH, About, CauseWords, CheckKind
from biodance.effects.body_mass import BodyMass
from biodance.lab.plates.faults import GAIN
from biodance.motion.newton import facing, trunk_of
from biodance.records import Array, Trial, Wrench
from biodance.spatial import wrench_about_point

_LARGE, _DEAD = 0.1, -0.9
"""Gain of a whole plate, five typical sizes, that statistics hold for nearly impossible; and one that reads a tenth of
its load or less: what it carried is lost."""
_RIGHT = 0.03
"""Share by which the weight of a trial may be wrong that is right: clothes and shoes, a step."""
_SURE = 0.03
"""Standard deviation of such a gain, and how far those of several trials may differ: that of the weight, twice."""
_SIDEWAYS, _AGAIN = 0.004, 0.003
"""m: sd of the place of the pressure to the left of the table's centre of mass in standing and squats (clean ones of 4
public laboratories lie 0.5 to 4 mm off, two simulated persons 4 to 6 mm), and between trials of a person."""
_BESIDE = 3.0
"""Standard deviations (`_SIDEWAYS`) from which pressure beside the body is no habit of a person."""
_LASTS = 1.0
"""s that a trial tells: within a step or two the place wanders by 16 mm."""
_NAMED, _TOLD = 4.0, 9.0
"""Differences of squared deviations: two in natural logarithm of the evidence for a name; three standard deviations
from which two causes are told apart."""
_LOADED = 0.02
"""Share of the need under which the place of a plate's pressure says nothing: its centre stands for it."""

_STAYS = 0.25
"""m that a foot goes over the floor where nobody steps: less than a step (the pelvis goes back by more in a deep
squat). Whoever walks treads on each plate once, and where the pressure lies over one step says nothing of what the
plate reads.
"""


@dataclass(frozen=True)
class _Carried:
    """Force on all plates over the need, how far left its place is (m), and by plate the gain that explains the force,
    with how far left the place is then; by plate what it reads of its load to explain the place (`placed`), and the
    force over the need then, both as logarithms.
    """

    ratio: float
    off: float
    plates: dict[str, tuple[float, float]]
    placed: dict[str, tuple[float, float]]


def _carried(recorded: Recorded) -> dict[str, _Carried]:
    """Return what the plates of each trial carry that lasts and that Newton weighs (`_carried_by_plates`)."""
    newton = recorded.newton.items()
    told = {name for name, one in newton if one.seconds >= _LASTS and one.mass_sd < _RIGHT * one.mass}
    every = {case.trial.name: _carried_by_plates(case) for case in recorded.cases if case.trial.name in told}
    return {name: one for name, one in every.items() if one is not None}


def _carried_by_plates(case: Case) -> _Carried | None:
    """Return what the plates of a trial carry against what the movement needs, over the frames in which the markers
    show that they alone carry: a plate that reads too little in every channel takes weight away on its own side, a
    person lighter than declared stays over the middle. None without such frames, with fewer than two plates, or of
    somebody who goes over them.
    """
    plates = case.trial.plates
    trunk = trunk_of(case.trial, mass=float(case.phi[::10].sum())) if len(plates) > 1 else None
    if trunk is None or trunk.covered.size != len(case.predicted) or not trunk.covered.any():
        return None
    feet = [k for k, name in enumerate(case.body.segments) if name.endswith("_foot")]
    ankles = case.poses.points(feet, np.zeros((len(feet), 3)))[trunk.covered, :, :2]
    if np.linalg.norm(np.ptp(ankles, axis=0), axis=1).max(initial=0.0) > _STAYS:
        return None
    middle = np.mean([plate.centre for plate in plates], axis=0)
    means = [
        wrench_about_point(value[trunk.covered], middle).mean(axis=0)
        for value in (case.predicted, *(plate.wrench.value for plate in plates))
    ]
    need, own = means[0], means[1:]
    total = np.sum(own, axis=0)
    if not (np.isfinite(total).all() and need[2] > 0 and total[2] > 0):
        return None
    ahead = facing(case.body, case.motion)
    left, lacks = np.array([-ahead[1], ahead[0]]), need[2] - total[2]
    found, placed = {}, {}
    off = float((_place(total) - _place(need)) @ left)
    for plate, wrench in zip(plates, own, strict=True):
        right = wrench[2] + lacks
        place = _place(wrench) if wrench[2] > _LOADED * need[2] else (plate.centre - middle)[:2]
        if right > 0:
            # Where all plates' pressure would lie if this plate also carried what lacks, at its
            # own place: mean by force.
            corrected = (total[2] * _place(total) + lacks * place) / need[2]
            found[plate.name] = float(wrench[2] / right - 1), float((corrected - _place(need)) @ left)
        away = float((place - _place(need)) @ left)
        if abs(away) <= abs(off):
            continue  # nothing on this plate takes the pressure of all so far aside
        # total off + more away = 0: what more on this plate puts the pressure of all under the body.
        more = -total[2] * off / away
        if min(wrench[2], wrench[2] + more, total[2] + more) > 0:
            share, weight = wrench[2] / (wrench[2] + more), (total[2] + more) / need[2]
            placed[plate.name] = float(np.log(share)), float(np.log(weight))
    return _Carried(float(total[2] / need[2]), off, found, placed)


def _place(wrench: Array) -> Array:
    """Return where (2,) m a wrench (6,) presses, in the plane of its point."""
    # x = -My / Fz, y = Mx / Fz about the point of the wrench.
    return np.array([-wrench[4], wrench[3]]) / wrench[2]


class PlateGain(InstalledPlate):
    """A relative ``gain`` (0.04: reads 4 % too much) of channel ``target`` about the plate's centre."""

    name = "plate_gain"
    fault = GAIN
    by_load = True
    prior = 0.04
    parameters = (
        Parameter(
            "gain",
            "1",
            0.02,
            "3-5 N under dead loads of some hundred newtons (Cappello 2011, PMID 21392999)",
            # Gain that matters: makers' accuracy, 0.2 to 0.5 % of full scale.
            least=0.005,
            usual=0.02,
            alike=0.004,
        ),
    )
    separated_by = "Squats against standing: the channel's own size must change."
    advice = "Check the channel with dead weights; correct sensitivity or calibration matrix."
    about = About(
        what="A channel of a force plate reads a constant factor too much.",
        signature="The residual of one channel follows that channel itself.",
        look_alikes=(
            "All six gains together are a wrong body mass, exactly; the gain of Fz alone re-fits into the segment "
            "masses and leaves the fit as good as before."
        ),
        settled_by=(
            "The scale's weight and by differences between channels. Where one of several plates reads too little in "
            "all channels, the pressure of all lies beside the body, on the other plate's side: so large a gain is "
            "found before any statistics."
        ),
    )
    words = CauseWords("{it} reads {size} too {more}{between}", CALIBRATE, "a wrong gain", TOO_MUCH)
    explains = (CheckKind.WEIGHT, CheckKind.FORCES)
    followed = (Quantity("gain", "1", name, "Fz", 0.003, 0.01, 0.1),)
    """Typical sizes of seven real visits of one laboratory (docs/benchmarks/plates.md)."""

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the plates that read a tenth too much or too little in all channels: in all trials, where the body's
        mass may be wrong instead, or in some, where the others show that it is not.
        """
        found = _carried(recorded)
        wrong = {name: one for name, one in found.items() if abs(one.ratio - 1) > _RIGHT}
        right = [one.off for name, one in found.items() if name not in wrong]
        if "mass" in recorded.session.subject.guessed and right and abs(np.mean(right)) > _BESIDE * _SIDEWAYS:
            return cls._unlike(found, float(np.mean(right)))  # no trial is right: these plates weighed the person
        if right:
            each = ({name: one} for name, one in wrong.items())
            failed = [cls._reads(some, float(np.mean(right)), _AGAIN, tuple(some)) for some in each]
        else:
            failed = [cls._reads(wrong, 0.0, _SIDEWAYS, ())] if wrong else []
        return tuple(one for one in failed if one) or (
            (QualityCheck("gain of whole plates", True, "No plate reads another share of all its loads."),)
            if found
            else ()
        )

    @classmethod
    def _reads(
        cls, found: Mapping[str, _Carried], usual: float, sd: float, trials: tuple[str, ...]
    ) -> QualityCheck | None:
        """Return the plate whose gain explains ``trials`` (() = all) better than a wrong mass, if one does."""

        def apart(off: list[float]) -> float:
            # Squared deviation of the place of pressure, in standard deviations: chi-square of
            # one degree of freedom.
            return float(((np.mean(off) - usual) / sd) ** 2)

        mass = np.inf if trials else apart([one.off for one in found.values()])
        ranked = []
        for name in next(iter(found.values())).plates:
            sizes = [one.plates[name] for one in found.values() if name in one.plates]
            gains = [gain for gain, _ in sizes]
            if len(sizes) == len(found) and np.ptp(gains) < 2 * _SURE and abs(np.mean(gains)) > _LARGE:
                ranked.append((apart([off for _, off in sizes]), name, float(np.mean(gains))))
        off, plate, gain = min(ranked, default=(np.inf, "", 0.0))
        # Better than a wrong mass by `_NAMED`, and not unlikely by itself.
        if not off < min(mass - _NAMED, _TOLD):
            return None
        alike = [(cls.name, name) for other, name, _ in ranked if name != plate and other - off < _TOLD]
        alike += [(BodyMass.name, "")] * (mass - off < _TOLD)
        text = f"{plate} reads {1 + gain:.2f} times its load in every channel{f', in {trials[0]}' if trials else ''}."
        return QualityCheck(
            "gain of whole plates", False, text, cls.name, plate, gain, "gain", "1",
            sd=_SURE, trials=trials, alike=tuple(alike),
        )  # fmt: skip

    @classmethod
    def _unlike(cls, found: Mapping[str, _Carried], beside: float) -> tuple[QualityCheck, ...]:
        """Return the plate that reads another share of its loads than the others, if the pressure of all, now
        ``beside`` the body (m), then lies under it in every trial, and weighs one person. Which of two it is, only the
        person's mass tells.
        """
        ranked = []
        for name in next(iter(found.values())).placed:
            each = np.array([one.placed[name] for one in found.values() if name in one.placed])
            share = float(each[:, 0].mean())
            # In proportion to how far the pressure of all lies beside the body, which trials repeat to `_AGAIN`.
            near = abs(share / beside) * _BESIDE * _AGAIN
            alike = len(each) == len(found) > 1 and bool((np.ptp(each, axis=0) < [near, 2 * _RIGHT]).all())
            if alike and abs(np.expm1(share)) > _LARGE:
                ranked.append((float(np.expm1(share)), name))
        if not ranked:
            return ()
        gain, plate = min(ranked)
        others = tuple((cls.name, name) for _, name in ranked if name != plate)
        text = f"{plate} reads {1 + gain:.2f} times what the other plates read for the same load."
        return (
            QualityCheck(
                "gain of whole plates", False, text, cls.name, plate, gain, "gain", "1", sd=_SURE, alike=others
            ),
        )

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial with the plate's record divided by its gain; without plates where that is dead."""
        if found.size < _DEAD:
            return replace(trial, plates=())
        # Reads (1 + gain) times the load.
        plates = (
            replace(p, wrench=Wrench(p.wrench.time, p.wrench.value / (1 + found.size))) if p.name == found.target else p
            for p in trial.plates
        )
        return replace(trial, plates=tuple(plates))


EFFECT = PlateGain
