"""What the pipeline found in one trial: the records of `TrialResult`. Computes nothing.

All records are frozen; arrays are in SI units in the lab frame (z up); a wrench is the ground's action on the subject
about the lab origin.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.errors import TrialRefused
from biodance.identification.statistics import Fit
from biodance.lab.markers.signals import MarkerGaps
from biodance.lab.plates.faults import PlateCorrection, correction_doubts
from biodance.lab.prepare import highest_frequency
from biodance.motion.contact import Contact
from biodance.motion.newton import QuietStanding
from biodance.records import CHANNEL_TITLES, Array, LeftOut, Motion, Trial, Wrench

if TYPE_CHECKING:
    import pandas as pd

Status = Literal["ok", "warning", "refused"]


@dataclass(frozen=True)
class Step:
    """One step on one trial or on the session.

    ``status`` "done"; "refused": the data cannot carry it, ``text`` says why and what to do; "failed": a fault of
    biodance itself.
    """

    name: str
    status: Literal["done", "refused", "failed"]
    text: str = ""


ON_A_FRAME = "scale on a frame"
"""Name of the step that scales a body on one frame of a moving trial, without a static one."""


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """Distances (m) to the model: by marker ``names`` (K), NaN = never seen, in all, ``by_group`` of the body."""

    names: tuple[str, ...]
    rms: Array
    max: Array
    total_rms: float
    total_max: float
    by_group: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class WrenchComparison:
    """Measured beside simulated wrench.

    ``time`` (T,) s; ``measured``, ``simulated`` (T, 6) N, N·m about the lab origin; ``used`` (T,) True where the plates
    measure all that the ground does; ``rms`` (6,) N, N·m and ``correlation`` (6,) over the used frames, NaN = not
    defined; ``notes`` why frames were left out.
    """

    time: Array
    measured: Array
    simulated: Array
    used: NDArray[np.bool_]
    rms: Array
    correlation: Array
    notes: tuple[str, ...] = ()

    def table(self) -> "pd.DataFrame":
        """Return measured and simulated wrench over time, and whether a frame is used.

        Returns
        -------
        pandas.DataFrame
            Index time (s); ``Fx measured (N)`` ..., ``Fx simulated (N)`` ... about the lab origin, ``used``.

        Examples
        --------
        >>> result["squat_1"].comparison.table().shape[1]
        13
        """
        import pandas as pd

        titles = [title.replace(" (", f" {which} (") for which in ("measured", "simulated") for title in CHANNEL_TITLES]
        out = pd.DataFrame(np.hstack([self.measured, self.simulated]), pd.Index(self.time, name="time (s)"), titles)
        return out.assign(used=self.used)

    def plot_wrench(self) -> NDArray[Any]:
        """Draw the measured beside the simulated wrench; frames that are not used are grey.

        Returns
        -------
        numpy.ndarray
            (6,) matplotlib axes: Fx, Fy, Fz, Mx, My, Mz over time.

        Examples
        --------
        >>> result["squat_1"].comparison.plot_wrench()[2].get_ylabel()
        'Fz (N)'
        """
        return display.side_by_side(self.time, self.measured, self.simulated, self.used, CHANNEL_TITLES)


OPEN = "posture left open"
"""The check of frames in which the markers do not fix the posture; they are left out of all comparisons of forces."""


@dataclass(frozen=True)
class Check:
    """One row of the quality table: ``value`` with its unit, the ``limit`` it is held against, whether ``inside``."""

    what: str
    where: str
    value: str
    limit: str
    inside: bool
    advice: str = ""


class WeighedBy(Enum):
    """How a session was weighed."""

    STANDING = "quiet standing"
    STRIDES = "whole strides"
    NEWTON = "the force against the trunk"


@dataclass(frozen=True)
class Weighing:
    """The ``mass`` kg on the plates with its standard deviation ``sd``, ``by`` what, in which ``trials``."""

    mass: float
    sd: float
    by: WeighedBy
    trials: tuple[str, ...]


@dataclass(frozen=True)
class ForceGain:
    """RMS difference (N, x y z) of forces ``without`` and ``with_them``, the joints shown, by the table's masses."""

    trial: str
    without: tuple[float, ...]
    with_them: tuple[float, ...]


def forces_told(forces: Sequence[ForceGain]) -> tuple[str, ...]:
    """Return in one sentence what the joints shown bring to the forces, horizontal and vertical; () without any."""
    if not forces:
        return ()
    # (trials, 3) N RMS by axis; over the axes squares add up, over the trials their mean counts
    without, with_them = (np.array([getattr(one, name) for one in forces]) for name in ("without", "with_them"))
    told = []
    for name, axes in (("horizontal", slice(0, 2)), ("vertical", slice(2, 3))):
        before, after = (float(np.sqrt(np.mean(np.sum(x[:, axes] ** 2, axis=1)))) for x in (without, with_them))
        change = 100 * (after / before - 1)
        word = "does not change" if abs(change) < 1 else f"{'falls' if change < 0 else 'grows'} by {abs(change):.0f} %"
        told.append(f"that of the {name} force {word} ({before:.1f} to {after:.1f} N)")
    return (
        f"Measured and simulated forces chose none of these joints; their RMS difference with them: {', '.join(told)}.",
    )


@dataclass(frozen=True, eq=False)
class TrialResult:
    """One trial after the ``steps`` so far: ``trial`` prepared (as read where preparing was refused); ``gaps`` as
    recorded, before any was filled; ``contact`` of the feet with the ground by the tracked body; ``recorded`` as read,
    until it is tracked.

    None where the data could not carry a result.
    """

    trial: Trial
    steps: tuple[Step, ...]
    gaps: tuple[MarkerGaps, ...] = ()
    fit: MarkerFit | None = None
    motion: Motion | None = None
    comparison: WrenchComparison | None = None
    standing: QuietStanding | None = None
    checks: tuple[Check, ...] = ()
    contact: Contact | None = None
    left_out: Mapping[LeftOut, float] = field(default_factory=dict)
    recorded: Trial | None = None

    def __repr__(self) -> str:
        close = f", markers {1000 * self.fit.total_rms:.1f} mm from the body" if self.fit else ""
        return f"TrialResult({self.name!r}, {self.trial.role}, {self.status}{close})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, self.reasons)

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.trial.name

    @property
    def moved(self) -> Motion:
        """The motion. Raises TrialRefused: the trial gives none; the message says why."""
        if self.motion is None:
            raise TrialRefused(f"Trial {self.name}: it gives no motion. {self.reason}".strip())
        return self.motion

    @property
    def usable(self) -> bool:
        """Whether all steps so far were done."""
        return all(step.status == "done" for step in self.steps)

    @property
    def compared_s(self) -> float:
        """For how many seconds the measured wrench is compared with the simulated one, after all gates."""
        found = self.comparison
        if found is None or self.motion is None or self.motion.time.size < 2:
            return 0.0
        left = (self.left_out.get(reason, 0.0) for reason in (LeftOut.FORCES_DIFFER, LeftOut.SHORT_RUN))
        return max(0.0, float(found.used.sum()) / self.motion.rate - sum(left))

    @property
    def gaps_percent(self) -> float:
        """Share of all marker samples that were not seen, %; NaN without markers."""
        return float(np.mean([gap.percent for gap in self.gaps])) if self.gaps else float("nan")

    @property
    def status(self) -> Status:
        """State: "refused" where nothing after preparing was done, "warning": a person must look, else "ok"."""
        if all(step.status != "done" or step.name == "prepare" for step in self.steps):
            return "refused"
        return "warning" if self.reasons or not all(check.inside for check in self.checks) else "ok"

    @property
    def reasons(self) -> tuple[str, ...]:
        """All refusals and warnings of this trial, each once, in order."""
        refusals = [step.text for step in self.steps if step.status != "done"]
        return tuple(dict.fromkeys([*refusals, *self.trial.warnings]))

    @property
    def reason(self) -> str:
        """The `reasons` and the checks outside their limits as one text; "" if there are none."""
        outside = [f"{one.what}: {one.value}, should be {one.limit}." for one in self.checks if not one.inside]
        return " ".join([*self.reasons, *(f"{said[:1].upper()}{said[1:]}" for said in outside)])


@dataclass(frozen=True, eq=False)
class Still:
    """One instant to draw in 3-D.

    ``bones`` (B, 2, 3) m lines with ``sides`` (B) "left", "right" or "middle"; ``markers`` (K, 3) m as measured;
    ``plates`` (P, 4, 3) m corners; ``com`` (3,) m; ``force`` and ``cop`` (3,) N, m of the total wrench (NaN =
    unloaded); ``forward`` (2,) unit vector the subject faces. ``boxes`` (N, 2, 3) m of the segments with ``rotations``
    (N, 3, 3) and ``positions`` (N, 3) m in the lab and their ``box_sides``; ``residual`` (3,) N measured minus
    predicted force, ``load`` (3,) m place of a load that was found (NaN = none); ``about`` what the picture shows, one
    sentence.
    """

    trial: str
    time: float
    bones: Array
    sides: tuple[str, ...]
    markers: Array
    plates: Array
    com: Array
    force: Array
    cop: Array
    forward: Array
    boxes: Array = field(default_factory=lambda: np.empty((0, 2, 3)))
    rotations: Array = field(default_factory=lambda: np.empty((0, 3, 3)))
    positions: Array = field(default_factory=lambda: np.empty((0, 3)))
    box_sides: tuple[str, ...] = ()
    residual: Array = field(default_factory=lambda: np.full(3, np.nan))
    load: Array = field(default_factory=lambda: np.full(3, np.nan))
    about: str = ""


def trial_fit(result: TrialResult, corrections: tuple[PlateCorrection, ...] = ()) -> Fit | None:
    """Return what a trial gives to fit, with the doubt of ``corrections`` made in it; None without any frame."""
    found, trial = result.comparison, result.trial
    if found is None or result.motion is None or not found.used.any():
        return None
    doubts = {"doubts": correction_doubts(trial, corrections)} if corrections else {}
    measured, cutoff = Wrench(found.time, found.measured), highest_frequency(trial.settings)
    return Fit(trial.name, result.motion, measured, found.used, trial.settings.outlier, cutoff=cutoff, **doubts)
