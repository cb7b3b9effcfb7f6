"""A session identified by the quadratic programme of the paper, beside its posterior."""

from dataclasses import replace

from biodance.errors import TrialRefused
from biodance.identification.paper_programme import identify_as_paper
from biodance.pipeline.identification import FITTED_ROLES, fits_of_roles, predicted
from biodance.pipeline.results import SessionResult


def by_paper(result: SessionResult) -> SessionResult:
    """Return an identified session with the parameters of the paper's programme (eq. 8) from the same trials, validated
    on the same kept ones; its posterior stays beside it (``identification.posterior``), with loads and changes, which
    the programme does not know. As it is where nothing was identified.
    """
    beside = result.identification
    if beside is None:
        return result
    fits = fits_of_roles(result.trials, FITTED_ROLES, *result.corrections)
    try:
        found = identify_as_paper(beside.identification, fits)
    except TrialRefused:
        return result
    one = replace(
        beside, identification=found, posterior=beside, notes=found.notes, fitted=(), validations=(), gain=None
    )
    if found.status == "failed":
        one = replace(one, failures={**beside.failures, "segments": found.cause}, agreements={}, shown=None)
    else:
        one = replace(predicted(one, result.trials, result.weighed), shown=None)
    return replace(result, identification=one)
