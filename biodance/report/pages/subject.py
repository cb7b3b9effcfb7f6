"""The page for the person who was measured: plain words, ranges first, at most two A4 pages; computes nothing."""

from importlib.resources import files

import numpy as np

from biodance.pipeline import for_subject
from biodance.pipeline.for_subject import PartMass, SubjectAccount
from biodance.report.figures.style import svg_address
from biodance.report.figures.subject import subject_figure

PLAIN_NAMES = {
    "pelvis": "hips",
    "right_thigh": "right thigh",
    "right_shank": "right lower leg",
    "right_foot": "right foot",
    "left_thigh": "left thigh",
    "left_shank": "left lower leg",
    "left_foot": "left foot",
    "trunk_head": "chest, belly and head",
    "right_upper_arm": "right upper arm",
    "right_forearm_hand": "right lower arm and hand",
    "left_upper_arm": "left upper arm",
    "left_forearm_hand": "left lower arm and hand",
}
_WHY = {
    for_subject.WHY_STOPPED: "The work was stopped before its end.",
    for_subject.WHY_NOTHING: "We have no test in which you moved while both feet were on our plates.",
    for_subject.WHY_IMPOSSIBLE: "The numbers did not fit any real body. So something went wrong in the test.",
    for_subject.WHY_DOUBTED: "The small balls on your skin did not tell us well where your joints are.",
    for_subject.WHY_FAULTY: "The plates and the cameras did not agree. We must first find out why.",
    "mass on the plates": "The weight on our plates was not the weight we wrote down.",
    "centre of mass off": "The plates and the cameras did not agree on where you stood.",
    "marker distance": "The small balls on your skin were not where our model of you had them.",
    "posture left open": "The cameras could not see all parts of you all the time.",
    "markers not seen": "The cameras lost some of the small balls on your skin for too long.",
    "fully measured": "You had both feet on our plates for too short a time.",
    "force difference": "The push on the plates was not what your moves should give.",
}
"""Reason for withholding, by its beginning -> a sentence for the subject."""
_ELSE = "One of our checks failed."


def plain_reasons(reasons: tuple[str, ...]) -> tuple[str, ...]:
    """Return sentences for the subject, each once."""
    said = [next((text for start, text in _WHY.items() if one.startswith(start)), _ELSE) for one in reasons]
    return tuple(dict.fromkeys(said))


def kilograms(part: PartMass) -> str:
    """Return the range of a part; "not measured well" where there is none."""
    return _between(part.low, part.high) if part.measured else "not measured well"


def subject_page(account: SubjectAccount) -> str:
    """Return the page as HTML text; the same account gives the same characters."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    folder = files("biodance.report") / "templates"
    parts = [(_name(part), kilograms(part), part) for part in account.parts]
    visit = account.visit
    return environment.from_string((folder / "subject.html.j2").read_text(encoding="utf-8")).render(
        style=Markup((folder / "subject.css").read_text(encoding="utf-8")),
        account=account,
        facts=[
            (what, str(value)[:10] if what == "Date" else value)
            for what, value in (("Lab", visit.lab), ("Done by", visit.operator), ("Date", visit.date))
            if value
        ],
        parts=parts,
        picture=_picture(account),
        weight=_between(*account.weight) if np.isfinite(account.weight[0]) else "",
        together=(_name(account.together), kilograms(account.together)) if account.together else None,
        reasons=plain_reasons(account.withheld),
    )


def _picture(account: SubjectAccount) -> str:
    """Return the address of the picture, "" without a body."""
    if account.body is None or not account.parts:
        return ""
    labels = {p.segments[0]: f"{_name(p)}\n{kilograms(p)}" for p in account.parts}
    measured = frozenset(p.segments[0] for p in account.parts if p.measured)
    return svg_address(subject_figure(account.body, labels, measured))


def _name(part: PartMass) -> str:
    *first, last = [PLAIN_NAMES.get(name, name.replace("_", " ")) for name in part.segments]
    return f"{', '.join(first)} and {last}" if first else last


def _between(low: float, high: float) -> str:
    """Return a range rounded outwards, so that it holds at least what was found."""
    return f"{np.floor(10 * low) / 10:.1f} to {np.ceil(10 * high) / 10:.1f} kg"
