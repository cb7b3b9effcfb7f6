"""The effects themselves in a diagnosis that names them."""

from collections.abc import Mapping
from dataclasses import replace

from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.effects import Cause


def of_family(one: Diagnosis, family: Mapping[str, Cause]) -> Diagnosis:
    """Return the diagnosis whose findings hold their effects of the ``family`` that was asked: what is known of one
    that was given as an object stands nowhere else.
    """

    def known(finding: Finding) -> Finding:
        alike = tuple(replace(alias, kind=family.get(alias.effect)) for alias in finding.set)
        return replace(finding, kind=family.get(finding.effect), set=alike)

    return replace(one, findings=tuple(map(known, one.findings)), resembles=tuple(map(known, one.resembles)))
