"""What the pipeline found in one session: the records that the report draws and that results.json holds. Computes
nothing.

All records are frozen; arrays are in SI units in the lab frame (z up); a wrench is the ground's action on the subject
about the lab origin.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.diagnosis.accept import Gain, Residuals
from biodance.diagnosis.diagnosis import Diagnosis, Finding, Verdict
from biodance.display import cause_in_words
from biodance.effects import QualityCheck
from biodance.effects._base.exchanged_labels import Pair, Spans
from biodance.identification.identification import Identification
from biodance.inference.decision import Inferred
from biodance.inference.hypotheses import Key
from biodance.lab.plates.faults import PlateCorrection
from biodance.motion.ik.functional_joints import JointGain
from biodance.motion.newton import QuietStanding
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.trial import ON_A_FRAME, Check, ForceGain, Step, TrialResult, Weighing, forces_told
from biodance.records import Mask, Session, Sip, Subject, by_name
from biodance.records.attention import Doubt
from biodance.settings import Settings

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Placed:
    """Who moves: the ``body`` with the joints that its markers show (``gains`` says what each brings to them), its
    ``source`` in words, ``plain`` without these joints, what is known of it before (``prior``; None for the table), and
    the ``steps`` to it; from the ``known`` body of an earlier session where there is one. Frames ``hidden`` (T,) of
    each trial, in which something else carries, placed no joint.
    """

    body: Body | None
    source: str
    plain: Body | None = None
    gains: tuple[JointGain, ...] = ()
    prior: Sip | None = None
    steps: tuple[Step, ...] = ()
    known: Body | None = None
    hidden: tuple[Mask, ...] = ()

    @property
    def taken(self) -> tuple[str, ...]:
        """Names of the joints beyond the usual axes that the body has."""
        return tuple(gain.name for gain in self.gains if gain.taken)


@dataclass(frozen=True, eq=False)
class SessionResult:
    """A whole visit after all stages: ``result["squat_1"]`` is what was found in one trial.

    Parameters
    ----------
    session : Session
        As read, less ``corrections``, with the mass that the plates weighed where nobody declared one.
    placed : Placed
        Who moves, where that body comes from, and what was known of it before.
    steps : tuple
        What was done with the session, and what was refused with the reason.
    trials : tuple
        What was found in every trial: motion, comparison of the wrenches, quality.
    checks : tuple
        The session's own rows of the quality table.
    standing : Standing or None
        The quiet standing that shows the centre of mass over the centre of pressure, or None.
    identification : SessionIdentification or None
        None where no trial is to be identified from, or it was refused.
    weighed : Weighing or None
        The mass on the plates that is compared with the declared one, by standing, strides or Newton; None without.
    corrections : tuple of PlateCorrection
        What was taken off the plates of ``session`` before all stages.
    joint_forces : tuple of ForceGain
        What the joints that markers show bring to the forces of every trial; () where they show none.

    Examples
    --------
    >>> result
    SessionResult('visit': static ok, dance_1 ok, squat_1 ok)
    >>> result["squat_1"]
    TrialResult('squat_1', validate, ok, markers 6.8 mm from the body)
    """

    session: Session
    placed: Placed
    steps: tuple[Step, ...]
    trials: tuple[TrialResult, ...]
    checks: tuple[Check, ...] = ()
    standing: QuietStanding | None = None
    identification: SessionIdentification | None = None
    weighed: Weighing | None = None
    corrections: tuple[PlateCorrection, ...] = ()
    joint_forces: tuple[ForceGain, ...] = ()

    def __repr__(self) -> str:
        return (
            f"SessionResult({self.session.folder.name!r}: "
            f"{', '.join(f'{one.name} {one.status}' for one in self.trials)})"
        )

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), [self.placed.source])

    @property
    def subject(self) -> Subject:
        """The person."""
        return self.session.subject

    @cached_property
    def body(self) -> Body | None:
        """That moved, with a note on what its joints bring to the forces; None: no markers, mass or stature."""
        body, said = self.placed.body, forces_told(self.joint_forces)
        return replace(body, notes=(*body.notes, *said)) if body is not None and said else body

    @property
    def scaled(self) -> bool:
        """Whether the person's own markers scaled the body: on a static trial, or on a frame of a moving one."""
        return any(step.name in ("scale", ON_A_FRAME) and step.status == "done" for step in self.steps)

    def __getitem__(self, name: str) -> TrialResult:
        """Return what was found in the trial of that name; UnknownName lists all names."""
        return by_name(self.trials, name, f"trial of session {self.session.folder.name}")

    def __iter__(self) -> Iterator[TrialResult]:
        return iter(self.trials)

    def __len__(self) -> int:
        return len(self.trials)

    def table(self) -> "pd.DataFrame":
        """Return one row for each trial.

        Returns
        -------
        pandas.DataFrame
            Index trial; role, status, markers to the body (mm, RMS and largest), measured frames, RMS difference of
            force (N) and moment (N·m, about the lab origin) between plates and simulation with the table, reason.

        Examples
        --------
        >>> list(result.table().index)
        ['static', 'dance_1', 'squat_1']
        """
        import pandas as pd

        return pd.DataFrame([_row(one) for one in self.trials]).set_index("trial")

    @property
    def settings(self) -> Settings:
        """All that the analyst chose."""
        return self.session.settings

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """The session's own checks, then those of every trial."""
        return (*self.checks, *(check for trial in self.trials for check in trial.checks))

    @property
    def mass_difference(self) -> float:
        """Mass on the plates minus declared mass in % of the declared; NaN where either is unknown."""
        return 100 * (self.weighed.mass / self.subject.declared_mass - 1) if self.weighed else float("nan")

    @property
    def stopped(self) -> bool:
        """Whether Ctrl-C ended the run before all was done."""
        return any(step.name == "stop" for steps in (self.steps, *(t.steps for t in self.trials)) for step in steps)

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """What the body's notes warn about: improbable lengths, misplaced markers."""
        return tuple(note for note in (self.body.notes if self.body else ()) if isinstance(note, Doubt))

    @property
    def failures(self) -> Mapping[str, str]:
        """What identification could not compute, each with cause and cure."""
        return self.identification.failures if self.identification else {}


@dataclass(frozen=True, eq=False)
class MendedCopy:
    """What was undone in a copy of a session: labels ``exchanged``, and the ``checks`` that name all."""

    exchanged: Mapping[str, Mapping[Pair, Spans]]
    checks: tuple[QualityCheck, ...]

    @property
    def unsure(self) -> dict[Key, str]:
        """By cause that was undone although nothing tells it from others, which; nothing of the copy is proven then."""
        return {
            (one.effect, one.target): f"nothing tells it from {' or '.join(cause_in_words(*of) for of in one.alike)}"
            for one in self.checks
            if one.alike
        }


@dataclass(frozen=True, eq=False)
class SessionDiagnosis:
    """What the simulation of a visit gets wrong, and what accepting it changes.

    Parameters
    ----------
    diagnosis : Diagnosis
        Verdict and findings.
    inferred : Inferred or None
        The posterior; None where there was nothing to judge by.
    before, accepted : Identification or None
        What is identified without the findings and once they are accepted; None without findings.
    left : tuple or None
        What the body in use leaves of the kept trials, and what is left once the findings are accepted.
    failures : mapping
        What could not be computed ("what accepting changes"), with cause and cure.
    mended : MendedCopy or None
        The copy without large faults of forces, and with labels exchanged where that was asked for, in which all else
        was found; None where nothing was undone.
    gain : Gain or None
        Of all findings together on the kept trials; each has its own.
    judged : SessionResult or None
        The session in which all was found, with what its segments weigh: as it was examined, or that of ``mended``.

    Examples
    --------
    >>> found.verdict
    'nothing wrong'
    """

    diagnosis: Diagnosis
    inferred: Inferred | None = None
    before: Identification | None = None
    accepted: Identification | None = None
    left: tuple[Residuals, Residuals] | None = None
    failures: Mapping[str, str] = field(default_factory=dict)
    mended: MendedCopy | None = None
    gain: Gain | None = None
    judged: SessionResult | None = None

    def __repr__(self) -> str:
        return f"SessionDiagnosis({self.diagnosis.told})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.diagnosis.notes)

    @property
    def verdict(self) -> Verdict:
        """One of "nothing wrong", "named, complete", "named, incomplete", "unexplained"."""
        return self.diagnosis.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The causes named, in the order found."""
        return self.diagnosis.findings

    def table(self) -> "pd.DataFrame":
        """Return one row for each parameter of each finding, see `Diagnosis.table`.

        Returns
        -------
        pandas.DataFrame
            Empty where nothing is wrong.

        Examples
        --------
        >>> len(found.table())
        0
        """
        return self.diagnosis.table()


def _row(one: TrialResult) -> dict[str, Any]:
    """Return what the table of a session says about one trial."""
    nan, found = float("nan"), one.comparison
    return {
        "trial": one.name,
        "role": one.trial.role,
        "status": one.status,
        "marker rms (mm)": 1000 * one.fit.total_rms if one.fit else nan,
        "marker largest (mm)": 1000 * one.fit.total_max if one.fit else nan,
        "measured frames": int(found.used.sum()) if found else 0,
        "force rms (N)": float(np.linalg.norm(found.rms[:3])) if found else nan,
        "moment rms (N·m)": float(np.linalg.norm(found.rms[3:])) if found else nan,
        "reason": one.reason,
    }
