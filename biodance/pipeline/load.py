"""One load of a session, from one record: the search of the identification says how heavy it is, where and how sure,
and the diagnosis names that load, not a second one.
"""

from dataclasses import replace

from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.effects import CheckKind
from biodance.effects.added_mass import AddedMass
from biodance.identification.added_mass import LoadSearch
from biodance.inference.decision import UNPLACED_LOAD
from biodance.pipeline.identification import load_doubts
from biodance.pipeline.results import SessionResult
from biodance.pipeline.words import LOAD, cause_of, explained


def as_diagnosed(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session with what the ``diagnosis`` says of its load: told where it may be, else why not."""
    return with_causes_of_doubt(with_weighed_load(result, diagnosis), diagnosis)


def with_weighed_load(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session with its load told where nothing but its own weight spoke against it and it is more probable
    than none: a weight other than declared is a doubt about a load until the ``diagnosis`` names a load, alone or among
    causes that it cannot tell apart.
    """
    found = result.identification
    if found is None or not any(alias.effect == LOAD for one in diagnosis.findings for alias in one.set):
        return result
    plain, weighed = (set(load_doubts(result.all_checks, weighed=one)) for one in (False, True))
    search = replace(found.search, doubts=tuple(one for one in found.search.doubts if one not in plain - weighed))
    return replace(result, identification=replace(found, search=search)) if _likely(search) else result


def with_causes_of_doubt(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session whose doubt about a load points to the cause that the ``diagnosis`` found (none is a load) in
    place of its advice: who knows that the plate reads too much is not asked to weigh again.
    """
    found, causes = result.identification, [one for one in diagnosis.findings if one.effect != LOAD]
    if found is None or not found.search.doubts or not causes:
        return result
    pointed = {}
    for check in result.all_checks:
        for doubt in load_doubts([check], weighed=False):
            cause = cause_of(check.what, causes)
            pointed[doubt] = f"{doubt.removesuffix(check.advice)}{explained(cause)}" if cause else doubt
    doubts = tuple(pointed.get(doubt, doubt) for doubt in found.search.doubts)
    return replace(result, identification=replace(found, search=replace(found.search, doubts=doubts)))


def with_load(one: Diagnosis, search: LoadSearch | None) -> Diagnosis:
    """Return the diagnosis with the load that was found (`LoadSearch`) in place of its own, before a cause that cannot
    be told from it, as an alternative to one of the same weight, or beside what has another reason; where only its
    weight was named (`UNPLACED_LOAD`), on the segments that may carry it, as soon as it is more probable than none.
    """
    if search is None:
        return one
    heavy = next((finding for finding in one.findings if any(alias.effect == LOAD for alias in finding.set)), None)
    mine = [finding for finding in one.findings if finding.effect == LOAD]
    if heavy is not None and not mine:
        return _with(one, heavy, _placed(heavy, search))
    if not search.found or len(mine) > 1:  # the search knows one load only
        return one
    load = _finding(search, mine[0] if mine else None)
    if mine:
        return _with(one, mine[0], load)
    alike = next((finding for finding in one.findings if CheckKind.WEIGHT in finding.cause.explains), None)
    if alike is not None:
        return _with(one, alike, replace(alike, set=(*alike.set, *load.set)))
    return replace(one, findings=(*one.findings, load))


def _with(one: Diagnosis, finding: Finding, other: Finding) -> Diagnosis:
    """Return the diagnosis with another finding in the place of one."""
    return replace(one, findings=tuple(other if every is finding else every for every in one.findings))


def _likely(search: LoadSearch) -> bool:
    """Return whether a load is more probable than none, a wrong declared mass among what is none, and may be told."""
    return search.status != "none" and not search.doubts


def _placed(finding: Finding, search: LoadSearch) -> Finding:
    """Return a cause of weight, from which a load cannot be told, with that load on the segments of the search; the
    load first where it was found, or likely where only the weight was named: the search has compared it with a wrong
    declared mass, or with the reference, in every posture.
    """
    weight_only = any((alias.effect, alias.target) == UNPLACED_LOAD for alias in finding.set)
    if not (search.found or weight_only):
        return finding
    bayes = next(alias.log_bayes_factor for alias in finding.set if alias.effect == LOAD)
    here = tuple(Alias(LOAD, segment, bayes) for segment in search.segments)
    others = tuple(alias for alias in finding.set if alias.effect != LOAD)
    if _likely(search):
        return replace(_finding(search, None), set=(*here, *others))
    return replace(finding, set=(*others, *here))


def _finding(search: LoadSearch, named: Finding | None) -> Finding:
    """Return the load as a finding, with what the diagnosis knows of the one that it ``named``."""
    best, bayes = search.best, {one.segment: one.log_bayes_factor for one in search.suspects}
    own = Estimate("mass", best.mass, best.sd, "kg", best.interval)
    place = zip("xyz", best.place, best.place_sd, strict=True)
    parameters = (own, *(Estimate(f"place_{axis}", float(v), float(sd), "m") for axis, v, sd in place if v == v))
    others = tuple(alias for alias in (named.set if named else ()) if alias.effect != LOAD)
    alike = (*(Alias(LOAD, segment, bayes[segment]) for segment in search.segments), *others)
    if named is None:
        return Finding(LOAD, best.segment, parameters, alike, float("nan"), advice=AddedMass.advice)
    return replace(named, target=best.segment, parameters=parameters, set=alike)
