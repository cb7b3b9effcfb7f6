"""One load of a session, from one record: the search of the identification says how heavy it is, where and how sure,
and the diagnosis names that load, not a second one.
"""

from dataclasses import replace

from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Verdict
from biodance.effects.added_mass import AddedMass
from biodance.identification.added_mass import LoadSearch
from biodance.pipeline.checks import load_doubts
from biodance.pipeline.finding_words import CAUSES_OF_WEIGHT, LOAD
from biodance.pipeline.results import SessionResult


def with_weighed_load(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session with its load announced where nothing but its own weight spoke against it: a weight other
    than declared is a doubt about a load until the ``diagnosis`` names the load.
    """
    found = result.identification
    if found is None or not any(one.effect == LOAD for one in diagnosis.findings):
        return result
    plain, weighed = (set(load_doubts(result.all_checks, weighed=one)) for one in (False, True))
    search = replace(found.search, doubts=tuple(one for one in found.search.doubts if one not in plain - weighed))
    return replace(result, identification=replace(found, search=search)) if search.found else result


def with_load(one: Diagnosis, search: LoadSearch | None) -> Diagnosis:
    """Return the diagnosis with the load that was found (`LoadSearch`) in place of its own, as an alternative to a
    cause of the same weight that it names, or beside what has another reason; as it is where none is announced.
    """
    if search is None or not search.found:
        return one
    mine = [finding for finding in one.findings if finding.effect == LOAD]
    if len(mine) > 1:  # the search knows one load only
        return one
    load = _finding(search, mine[0] if mine else None)
    if mine:
        return replace(one, findings=tuple(load if finding is mine[0] else finding for finding in one.findings))
    alike = next((finding for finding in one.findings if finding.effect in CAUSES_OF_WEIGHT), None)
    if alike is not None:
        rest = tuple(alias for alias in alike.set if alias.effect != LOAD)
        both = replace(alike, set=(*rest, *load.set))
        return replace(one, findings=tuple(both if finding is alike else finding for finding in one.findings))
    told: Verdict = one.verdict if one.findings else "named, incomplete"
    if one.verdict == "nothing wrong":
        told = "named, complete"
    return replace(one, verdict=told, findings=(*one.findings, load))


def _finding(search: LoadSearch, named: Finding | None) -> Finding:
    """Return the load as a finding, with what the diagnosis knows of the one that it ``named``."""
    best, bayes = search.best, {one.segment: one.log_bayes_factor for one in search.suspects}
    own = Estimate("mass", best.mass, best.sd, "kg", best.interval)
    place = zip("xyz", best.place, best.place_sd, strict=True)
    parameters = (own, *(Estimate(f"place_{axis}", float(v), float(sd), "m") for axis, v, sd in place))
    others = tuple(alias for alias in (named.set if named else ()) if alias.effect != LOAD)
    alike = (*(Alias(LOAD, segment, bayes[segment]) for segment in search.segments), *others)
    if named is None:
        return Finding(LOAD, best.segment, parameters, alike, float("nan"), advice=AddedMass.advice)
    return replace(named, target=best.segment, parameters=parameters, set=alike)
