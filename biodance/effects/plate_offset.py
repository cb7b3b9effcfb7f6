"""A channel of a force plate does not read zero when nobody stands on it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import ChannelEffect, Parameter
from biodance.effects._base.quality_check import QualityCheck, Quantity, Recorded
from biodance.effects._base.words import ACCEPT, TOO_MUCH, About, CauseWords, CheckKind
from biodance.records import CHANNELS, Array, Plate, Session, Trial, Wrench, runs
from biodance.spatial import wrench_about_origin, wrench_about_point

USUAL_ZERO, VERTICAL_ZERO = 7.0, 18.0
"""N of horizontal and of vertical zero up to which laboratories have one without calling it a fault: public recordings
have up to 6 and 16, and readers take the vertical off."""
_EMPTY = 30.0
"""N of vertical force within which a plate may be empty: larger zeros are found by the readers (`find_baseline`)."""
_RINGS, _SHORTEST = 0.02, 0.03
"""s at each end of an empty stretch in which a plate rings or is touched, and s of what is left: a flight of a slow run
lasts 0.08 s."""
_QUIET = 3.0
"""N: scatter of the stretches of a trial, and difference of trials, up to which they read one zero (83 flights of a
runner scatter by 0.5 N; feet that rest lightly on a plate by 1 to 8)."""
_LEAST = {"N": 2.0, "N·m": 1.0}
"""N, N·m that matter: what a spot check before a session tolerates (2 N are 0.3 % of an adult's weight, 1 N·m is
1.4 mm of its centre of pressure)."""
_USUAL = {"N": USUAL_ZERO, "N·m": 2.0, "Fz": VERTICAL_ZERO}


class PlateOffset(ChannelEffect):
    """A constant ``offset`` (N or N·m) about the plate's centre in channel ``target``."""

    name = "plate_offset"
    prior = 0.04
    parameters = (
        Parameter(
            "offset",
            "N or N·m",
            5.0,
            "re-zeroing rule of +-5 N in laboratory guides (Codamotion)",
            least=_LEAST,
            usual=_USUAL,
        ),
    )
    separated_by = "Postures of different weight on the plate: squats, one leg, sitting down beside it."
    advice = "Record the empty plate before and after, and re-zero it."
    about = About(
        what="A channel of a force plate does not read zero when nobody stands on it.",
        signature="A constant in one channel, whatever the movement and whatever its speed.",
        look_alikes=(
            "For Fz a wrong body mass (which scales all channels), for moments a shifted plate or a CoM that is off "
            "in the trunk (which follow Fz), for Fx a tilted plate."
        ),
        settled_by=(
            "Movements that change Fz (squats) and by an unloaded recording: rows in which nobody is on the plate, "
            "and flights, are zeros of every channel, whoever read the file; what they read is found before any "
            "statistics and taken off."
        ),
    )
    words = CauseWords(
        "{it} reads {size} too {more}{between} all the time", f"Zero the plate{ACCEPT}", "a wrong zero", TOO_MUCH
    )
    explains = (CheckKind.WEIGHT, CheckKind.PRESSURE, CheckKind.FORCES)
    followed = (
        Quantity("offset_x", "N", name, "Fx", 0.5, 2.0, 0.05),
        Quantity("offset_y", "N", name, "Fy", 0.5, 2.0, 0.05),
        Quantity("offset_z", "N", name, "Fz", 0.5, 2.0, 0.05),
    )
    """Typical sizes of seven real visits of one laboratory (docs/benchmarks/plates.md) and the re-zeroing rules of
    laboratory guides (+-5 N).
    """

    def in_channel(self, case: Case) -> Array:
        """Return one; zero in a trial that saw the plate empty: there its reading was taken off."""
        return np.full(case.motion.time.size, 0.0 if self.plate_of(case).tared else 1.0)

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the forces that plates read while nobody is on them, where the reader did not take them off: one for
        all trials with the same zero, or several of different size.
        """
        found = _zeros(recorded.session)
        failed = [one for target, zeros in found.items() for one in cls._levels(target, zeros)]
        return tuple(failed) or (
            (QualityCheck("zero of the plates", True, "Empty plates read zero."),) if found else ()
        )

    @classmethod
    def _levels(cls, target: str, zeros: dict[str, tuple[float, bool]]) -> Iterator[QualityCheck]:
        """Yield each zero of one channel that is beyond the usual, with its trials, if one is still in the record."""
        usual, rest = VERTICAL_ZERO if target.endswith("Fz") else USUAL_ZERO, dict(zeros)
        while rest and any(left and abs(value) > usual for value, left in zeros.values()):
            first = max(rest.values(), key=lambda zero: abs(zero[0]))[0]
            same = {name: value for name, (value, _) in rest.items() if abs(value - first) < _QUIET}
            rest = {name: zero for name, zero in rest.items() if name not in same}
            size = float(np.mean(list(same.values())))
            if abs(size) > usual:
                where = f" in {', '.join(same)}" if len(same) < len(zeros) else ""
                text = f"{target} reads {size:.0f} N while nobody is on the plate{where}."
                trials = tuple(same) if where else ()
                yield QualityCheck(
                    "zero of the plates", False, text, cls.name, target, size, "offset", "N", sd=1.0, trials=trials
                )

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial without what the plate reads empty, in every channel."""
        name = found.target.rpartition(":")[0]
        return replace(trial, plates=tuple(_zeroed(p) if p.name == name or not name else p for p in trial.plates))


def _zeros(session: Session) -> dict[str, dict[str, tuple[float, bool]]]:
    """Return by target and trial what an empty plate reads (N), and whether it is still in the record."""
    found: dict[str, dict[str, tuple[float, bool]]] = {}
    single = all(len(trial.plates) < 2 for trial in session.trials)
    for trial in session.trials:
        for plate in trial.plates:
            # What the reader has taken off is known for forces only.
            reads = np.append(plate.zero, np.zeros(3)) if plate.tared else empty_reading(plate)
            if reads is None:
                continue
            for k, channel in enumerate(CHANNELS[:3]):
                target = channel if single else f"{plate.name}:{channel}"
                found.setdefault(target, {})[trial.name] = float(reads[k]), not plate.tared
    return found


def empty_reading(plate: Plate) -> Array | None:
    """Return what a plate reads (6,) N, N·m about its centre while nobody is on it, the median over all empty
    stretches; None without one, or where they differ.
    """
    wrench = plate.wrench
    if wrench.time.size < 3:
        return None
    trim, least = max(1, round(_RINGS * wrench.rate)), _SHORTEST * wrench.rate
    empty = [(a + trim, b - trim) for a, b in runs(np.abs(wrench.force[:, 2]) < _EMPTY) if b - a - 2 * trim >= least]
    if not empty:
        return None
    local = wrench_about_point(wrench.value, plate.centre)
    means = np.array([local[a:b].mean(axis=0) for a, b in empty])
    quiet = means[:, :2].std(axis=0).max() < _QUIET
    return np.median(means, axis=0) if quiet else None


def _zeroed(plate: Plate) -> Plate:
    """Return a plate without what it reads empty; as it is where the reader took that off, or nobody knows it."""
    reads = None if plate.tared else empty_reading(plate)
    if reads is None:
        return plate
    # The reading is about the plate's centre, the record about the lab origin.
    value = plate.wrench.value - wrench_about_origin(reads, plate.centre)
    return replace(plate, wrench=Wrench(plate.wrench.time, value))


EFFECT = PlateOffset
