"""A finding in words, the same wherever it is told: its place or places, its size, which checks it may explain."""

from collections.abc import Sequence

from biodance.diagnosis.diagnosis import Estimate, Finding
from biodance.display import cause_in_words, digits, listed, shown_unit, spaced
from biodance.effects.added_mass import AddedMass

LOAD = AddedMass.name


def in_words(finding: Finding) -> str:
    """Return a cause with its place, or all places that it may be at, and its size: ``plate gain Fz (gain 6 ± 0.2 %)``;
    a size that is hardly known is said to be (`Estimate.known`). A load is told by its mass; where its centre lies
    is said beside its segment.
    """
    name = f"{cause_in_words(finding.effect, finding.target)}{_elsewhere(finding)}"
    name += f" in {listed(finding.trials)}" if finding.trials else ""
    told = finding.parameters[:1] if finding.effect == LOAD else finding.parameters
    known = [p.known for p in finding.parameters if p.sd == p.sd]
    if not known:
        return name
    signs = finding.cause.words.signs if finding.cause.words else ("", "")
    sure = signs[told[0].value < 0] if any(known) else "its size is hardly known"
    return f"{name} ({', '.join(map(_size, told))}{sure and f'; {sure}'})"


def _elsewhere(finding: Finding) -> str:
    """Return where else the same cause may be, to go on its place with."""
    places = [cause_in_words("", alias.target) for alias in finding.set[1:] if alias.effect == finding.effect]
    return f" or {listed(places)}" if any(places) else ""


def _size(one: Estimate) -> str:
    """Return a parameter with its standard deviation as people say it: ``gain 6 ± 0.2 %``."""
    factor, unit = shown_unit(one.unit)
    return f"{spaced(one.name)} {digits(factor * one.value, 2)} ± {digits(factor * one.sd, 1)} {unit}".strip()


def cause_of(checked: str, findings: Sequence[Finding]) -> str:
    """Return the first finding that may explain a check of that name; "" for none."""
    found = next((one for one in findings if checked.startswith(one.cause.explains)), None)
    return f"{cause_in_words(found.effect, found.target)}{_elsewhere(found)}" if found else ""


def explained(cause: str) -> str:
    """Return the sentence that points from a check or a doubt to a cause (`cause_of`) that was found."""
    return f"{cause[:1].upper()}{cause[1:]}, which was found, may explain it."
