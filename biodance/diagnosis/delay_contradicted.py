"""A delay that simpler evidence contradicts: Newton's lag of the whole force behind the trunk."""

from dataclasses import replace

import numpy as np

from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.diagnosis.witness_inference import WitnessFindings
from biodance.effects.time_delay import TimeDelay
from biodance.observations.newton import Newton


def is_contradicted(finding: Finding, evidence: ObservedEvidence) -> bool:
    """Return whether a finding is a delay, and the total force goes with the trunk at an instant that is nearer to none
    than to it: feet are few and short, the force of all plates lasts as long as the trial.
    """
    lags = [one for one in evidence.observations if (one.observer, one.unit) == (Newton.name, "s")]
    if finding.effect != TimeDelay.name or not finding.parameters or not lags:
        return False
    share = np.array([one.sd**-2 for one in lags])
    lag = float(share @ [one.value for one in lags] / share.sum())
    return abs(lag) < abs(lag - finding.parameters[0].value)


def without_contradicted(by_witnesses: WitnessFindings, evidence: ObservedEvidence) -> WitnessFindings:
    """Return the findings of the witnesses without a delay that Newton contradicts."""
    kept = tuple(one for one in by_witnesses.findings if not is_contradicted(one, evidence))
    return replace(by_witnesses, findings=kept)
