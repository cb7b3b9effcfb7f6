"""The forces do not belong to the movement: another trial's file, a trigger that missed, a clock that ran away."""

from dataclasses import replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import About, CauseWords
from biodance.errors import BiodanceError
from biodance.identification.statistics import Fit, believable, standing_point
from biodance.motion.newton import TELLS, trunk_of
from biodance.records import Trial

_MOST = 0.5
"""Share of the frames on plates that the force gate leaves out from which most of a trial is lost."""
_MOVES = 0.05
"""Share of its mean by which the force swings in a movement (standing: 0.001 to 0.003, slow walking 0.05)."""
_ONE_SIDED = 0.9
"""Share of those frames in which the plates show too little from which something beside them carries: a chair."""


class UnrelatedForces(DiscreteEffect):
    """Forces that go with no movement of the trial, at any shift in time."""

    name = "unrelated_forces"
    separated_by = "Record the trial again, with the trigger checked."
    advice = "Look whether the force file is that of another trial, and whether both systems started together."
    about = About(
        what=(
            "The forces do not belong to the movement: another trial's file, a trigger that missed, a clock that ran "
            "away."
        ),
        signature=(
            "Most frames need another force than the plates show, and no shift in time makes the total force go with "
            "the trunk."
        ),
        look_alikes=(
            "A late clock (goes with the trunk once shifted), something that carries beside the plates (chair, rail: "
            "forces go with the trunk while it does not)."
        ),
        settled_by="Recording again with the trigger checked.",
    )
    words = CauseWords(
        "{forces} not those of the movement", "Look whether they are another trial's.", "unrelated forces"
    )

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the trials of which the force gate leaves out most, and whose force goes with no movement."""
        names, newton = [case.trial.name for case in recorded.cases], recorded.newton
        told = [(case, newton[name]) for case, name in zip(recorded.cases, names, strict=True) if name in newton]
        strange = [case for case, one in told if one.swing > _MOVES and one.correlation < TELLS]
        lost = {case.trial.name: share for case in strange if (share := _left_out(case)) > _MOST}
        if told and not lost:
            text = "The forces of every trial that tells belong to its movement."
            return (QualityCheck("forces and movement", True, text),)
        return tuple(
            QualityCheck(
                "forces and movement",
                False,
                f"The forces of {name} do not belong to this movement: {100 * share:.0f} % of its frames need another "
                "force than the plates show, at any shift in time.",
                cls.name,
                trials=(name,),
            )
            for name, share in lost.items()
        )

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial without its plates: nothing of it can be judged."""
        return replace(trial, plates=())


def _left_out(case: Case) -> float:
    """Return the share of frames on plates that cannot be believed; 0 where plates nearly always lack force."""
    trunk = trunk_of(case.trial, mass=float(case.phi[::10].sum()))
    use = np.asarray(np.isfinite(case.residual).all(axis=1))
    if trunk is not None and trunk.covered.size == use.size:
        use &= trunk.covered
    if not use.any():
        return 0.0
    try:
        fit = Fit(case.trial.name, case.motion, case.trial.wrench, use, case.trial.settings.outlier)
        wrong = use & ~believable(case.body, fit, standing_point((fit,)))[0].use
    except BiodanceError:
        return 0.0
    # Too large in the vertical force: a difference in moments has no sign that tells of a chair.
    large = wrong & (np.abs(case.residual[:, 2]) > case.trial.settings.outlier * np.median(case.predicted[:, 2]))
    one_sided = large.any() and np.mean(case.residual[large, 2] < 0) > _ONE_SIDED
    return 0.0 if one_sided else float(wrong.sum() / use.sum())


EFFECT = UnrelatedForces
