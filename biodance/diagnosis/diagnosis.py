"""The records of a diagnosis: what was found wrong, what it could be instead, what naming it gains, and what could not
be seen.

SI units; six channels are Fx Fy Fz (N) and Mx My Mz (N·m) about the middle of where the person stands.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from biodance import display
from biodance.diagnosis.consequence import Adequacy, Unobservable
from biodance.diagnosis.reasons import DOUBTS, DiagnosisStatus, Reason, status_of
from biodance.effects import known_cause
from biodance.identification.knowledge import SIGMAS
from biodance.records.attention import Attention, Judged

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from biodance.diagnosis.accept import Gain
    from biodance.diagnosis.witness_evidence import ObservedEvidence
    from biodance.effects import Cause, Checked, QualityCheck


Verdict = Literal["nothing wrong", "named, complete", "named, incomplete", "unexplained"]
ABOUT = "diagnosis"
"""What the sentence is about that says the verdict."""


@dataclass(frozen=True)
class Alias:
    """A cause that the data cannot tell from the one named; ``log_bayes_factor`` against none; ``kind``: `Finding`."""

    effect: str
    target: str
    log_bayes_factor: float
    kind: "Cause | None" = field(default=None, compare=False, repr=False)

    @property
    def cause(self) -> "Cause | Checked":
        """All that is known of the effect."""
        return self.kind or known_cause(self.effect)


@dataclass(frozen=True)
class Estimate:
    """One parameter of a cause: ``value`` with its standard deviation ``sd`` in ``unit``; ``skewed`` its 95 % interval
    where that is not 1.96 standard deviations to either side.
    """

    name: str
    value: float
    sd: float
    unit: str
    skewed: tuple[float, float] | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.skewed or (self.value - SIGMAS * self.sd, self.value + SIGMAS * self.sd)

    @property
    def known(self) -> bool:
        """Whether it lies two standard deviations from none, so that anything is known of it."""
        return abs(self.value) >= 2 * self.sd


@dataclass(frozen=True, eq=False)
class Finding:
    """One cause that was named.

    Parameters
    ----------
    effect, target : str
        As in the family `biodance.effects`: what, and where.
    parameters : tuple
        Each with name, value, sd, unit and 95 % interval.
    set : tuple
        All causes that the data cannot tell apart, the named one first.
    visible_fraction : float
        Share of its effect that remains visible when body and tolerances may adapt (0 = hides in the body).
    gain : Gain or None
        Its own on trials that were kept: accepted with all others, against the others alone; None without one.
    advice : str
        What settles it in the laboratory.
    changes : tuple of str
        What accepting it changes in the body.
    trials : tuple of str
        The trials in which it is; () for all.
    probability : float
        That it, or another cause of its set, is there.
    kind : Cause or None
        The effect itself where it is known (`of_family`); None: by its name, if it is of biodance or an entry point.

    Examples
    --------
    >>> for finding in found.findings:
    ...     print(finding)
    """

    effect: str
    target: str
    parameters: tuple[Estimate, ...]
    set: tuple[Alias, ...]
    visible_fraction: float
    gain: "Gain | None" = None
    advice: str = ""
    changes: tuple[str, ...] = ()
    trials: tuple[str, ...] = ()
    probability: float = 1.0
    kind: "Cause | None" = None

    @property
    def cause(self) -> "Cause | Checked":
        """All that is known of the effect."""
        return self.kind or known_cause(self.effect)

    def __repr__(self) -> str:
        sizes = ", ".join(f"{one.name} {one.value:.3g} ± {one.sd:.2g} {one.unit}" for one in self.parameters)
        return f"Finding({' '.join(filter(None, (self.effect, self.target)))}{f': {sizes}' if sizes else ''})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, (self.advice, *self.changes))

    @property
    def log_bayes_factor(self) -> float:
        """Evidence of the named cause against "nothing wrong", natural logarithm."""
        return self.set[0].log_bayes_factor


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What the simulation of a session gets wrong.

    Parameters
    ----------
    explained : bool
        Whether the findings explain all that matters, and it could be judged.
    findings : tuple of Finding
        In the order found.
    checks : tuple
        Checks before any statistics.
    adequacy : tuple
        Of what is left, worst first.
    unobservable : tuple
        Causes that would stay unseen at their typical size.
    limits : tuple
        Smallest sizes of all causes looked for.
    notes : tuple of str
        For the reader.
    candidates : tuple
        Every cause at the first round, most probable first.
    resembles : tuple of Finding
        Poor models of what is wrong: no findings, because too much is left with them, or the movement cannot tell.
    tolerated : tuple of Finding
        Causes that are there, and smaller than what matters in any laboratory (`diagnosis.consequence`).
    attention : tuple of Attention
        Sentences for a person, the verdict's first.
    judged : tuple of Judged
        What the verdict rests on.
    why : mapping of Reason to tuple of str
        Why it says no more (only standing, an unusual body), each with what it concerns.
    witnesses : ObservedEvidence or None
        What needs no model of the body: feet on plates, clocks, weights; None where there was nothing to see.
    p_clean, p_unknown : float
        Probability of nothing that matters, and of a cause that nobody described; NaN where nothing could be judged.

    Examples
    --------
    >>> found.diagnosis
    Diagnosis(nothing wrong)
    """

    explained: bool
    findings: tuple[Finding, ...]
    checks: "tuple[QualityCheck, ...]" = ()
    adequacy: tuple[Adequacy, ...] = ()
    unobservable: tuple[Unobservable, ...] = ()
    limits: tuple[Unobservable, ...] = ()
    notes: tuple[str, ...] = ()
    candidates: tuple[Alias, ...] = field(default=())
    resembles: tuple[Finding, ...] = ()
    tolerated: tuple[Finding, ...] = ()
    attention: tuple[Attention, ...] = ()
    judged: tuple[Judged, ...] = ()
    why: Mapping[Reason, tuple[str, ...]] = field(default_factory=dict)
    witnesses: "ObservedEvidence | None" = None
    p_clean: float = float("nan")
    p_unknown: float = float("nan")

    def __repr__(self) -> str:
        return f"Diagnosis({self.told})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.notes)

    @property
    def verdict(self) -> Verdict:
        """What it ends with, in the words of the results (`status` is the enum)."""
        if self.faults:
            return "named, complete" if self.explained else "named, incomplete"
        return "nothing wrong" if self.explained else "unexplained"

    @property
    def is_clean(self) -> bool:
        """Whether nothing wrong was found, and all that matters could be judged."""
        return self.explained and not self.faults

    @property
    def doubted(self) -> bool:
        """Whether no cause can be told from what was judged, whatever is left (`DOUBTS`)."""
        return not DOUBTS.isdisjoint(self.why)

    @property
    def status(self) -> DiagnosisStatus:
        """What it ends with."""
        return status_of(self.why, named=bool(self.faults), clean=self.is_clean)

    @property
    def probability(self) -> float:
        """Of what it ends with (`status`), certain where a limit is broken; NaN where nothing can be told."""
        ends = {
            DiagnosisStatus.NAMED: max((one.probability for one in self.faults), default=float("nan")),
            DiagnosisStatus.CLEAN: self.p_clean,
            DiagnosisStatus.UNKNOWN: 1.0 if Reason.LIMIT_BROKEN in self.why else self.p_unknown,
        }
        return ends.get(self.status, float("nan"))

    @property
    def faults(self) -> tuple[Finding, ...]:
        """The findings without what is only a habit of the laboratory."""
        return tuple(one for one in self.findings if not one.cause.habit)

    @property
    def told(self) -> str:
        """Verdict and names of the causes in one line."""
        causes = ", ".join(f"{one.effect} {one.target}".strip() for one in self.faults)
        partly = self.is_clean and any(one.level != "note" for one in self.attention if one.about == ABOUT)
        return f"{self.verdict}{' in what could be judged' if partly else ''}{f': {causes}' if causes else ''}"

    def table(self) -> "pd.DataFrame":
        """Return one row for each parameter of each finding.

        Returns
        -------
        pandas.DataFrame
            effect, target, parameter, value, sd, low and high of the 95 % interval, unit, visible fraction, log Bayes
            factor, advice.

        Examples
        --------
        >>> list(found.diagnosis.table().columns[:4])
        ['effect', 'target', 'parameter', 'value']
        """
        import pandas as pd

        columns = ["effect", "target", "parameter", "value", "sd", "low", "high", "unit"]
        rows = []
        for f in self.findings:
            own = f.visible_fraction, f.log_bayes_factor, f.advice
            for p in f.parameters or (Estimate("", float("nan"), float("nan"), ""),):
                rows.append((f.effect, f.target, p.name, p.value, p.sd, *p.interval, p.unit, *own))
        return pd.DataFrame(rows, columns=[*columns, "visible fraction", "log Bayes factor", "advice"])

    def plot_adequacy(self, *, axes: "Axes | None" = None) -> "Axes":
        """Draw how far what is left is from sessions without fault, per channel and band.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Bars of z in standard deviations, worst first.

        Examples
        --------
        >>> found.diagnosis.plot_adequacy().get_xlabel()
        'z of what is left'
        """
        drawn = display.axes_or_new(axes)
        names = [f"{one.channel} {one.band_hz[0]:g}-{one.band_hz[1]:g} Hz" for one in self.adequacy]
        drawn.barh(names[::-1], [one.z for one in self.adequacy][::-1], color=display.BLUE)
        drawn.set_xlabel("z of what is left")
        return drawn

    @property
    def worst(self) -> float:
        """Largest z of the residual that is left; 0 without any."""
        return float(np.max([a.z for a in self.adequacy], initial=0.0))
