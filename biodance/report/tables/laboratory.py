"""What the sessions of a laboratory say of its plates and of its own tolerances."""

from biodance.diagnosis.archive.changes import Change, Stranger
from biodance.diagnosis.archive.conditions import ConditionEffect
from biodance.diagnosis.archive.judge import PlateFinding, PlateLevel, said
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES
from biodance.display import spaced
from biodance.pipeline.learn import LearnedLaboratory
from biodance.pipeline.plates import PlatesJudged
from biodance.report.tables.schema import Row, Schema
from biodance.uncertainty.tolerances import shipped

_OFFSET = ("offset_x", "offset_y", "offset_z")


def _unit(one: PlateLevel | ConditionEffect | PlateFinding | Change) -> str:
    return PLATE_QUANTITIES[one.quantity].unit


CARD_ROW = Schema(
    "plate visits place_m=place_x.value,place_y.value place_sd_m=place_x.sd,place_y.sd gain=gain.value gain_sd=gain.sd "
    "offset_n=offset_x.value,offset_y.value,offset_z.value offset_sd_n=offset_x.sd,offset_y.sd,offset_z.sd "
    "delay_s=delay.value delay_sd_s=delay.sd",
    {
        "offset_taken_off": lambda card: min((card[one].taken_off for one in _OFFSET if one in card), default=None),
        "levels": Schema("quantity value sd between_visits_sd=between visits", {"unit": _unit}),
        "changes": Schema(
            "visit=visit.name plate quantity before after ci95=interval matters",
            {
                "date": lambda one: one.visit.date or None,
                "earliest": lambda one: one.earliest.date or one.earliest.name,
                "latest": lambda one: one.latest.date or one.latest.name,
                "unit": _unit,
            },
        ),
        "findings": Schema("effect target text quantity value ci95=interval", {"unit": _unit}),
    },
    "plate: {plate} | visits: {visits} | place x, y (mm): {place_m:mm1} | gain (%): {gain:%2} | "
    "offset Fx, Fy, Fz (N): {offset_n:1} | delay (ms): {delay_s:ms1} | changes: {changes:count}",
)
"""A plate over all its visits, its levels by their quantity, too. Of a change ``ci95`` is of the step, ``date`` of the
first visit after it.
"""
_CONDITION = Schema(
    "plate quantity factor level base value=shared.mean ci95=shared.interval between_persons_sd=shared.spread "
    "persons=#visits",
    {"unit": _unit, "persons_named": lambda one: sorted(one.persons)},
)


def plates_document(found: PlatesJudged) -> Row:
    """Return all that was found: a card per plate, persons, what all share, and what was left out; null where nothing
    tells a quantity.
    """
    judged = found.judgement
    return {
        "archive": found.archive.resolve().name,
        "visits": Schema("visit=name person date", {"date": lambda one: one.date or None}).rows(judged.visits),
        "plates": CARD_ROW.rows(vars(card) | {one.quantity: one for one in card.levels} for card in judged.plates),
        "persons": _persons(found),
        "common": _CONDITION.rows(judged.conditions),
        "attention": [
            {"level": "warn", "text": f"{card.plate}: {one.text}", "trial": "", "about": one.effect}
            for card in judged.plates
            for one in card.findings
        ],
        "refused": dict(found.refused),
        "notes": list(found.notes),
    }


def _persons(found: PlatesJudged) -> list[Row]:
    """Return every person with visits, what stands out, and what conditions do in that person's visits."""
    judged = found.judgement
    names = list(dict.fromkeys(visit.person for visit in judged.visits))
    return [
        {
            "person": name,
            "visits": sum(visit.person == name for visit in judged.visits),
            "findings": [
                *(_stranger(one) for one in judged.strangers if one.person == name),
                *(_of_person(one, name) for one in judged.conditions if name in one.persons),
            ],
        }
        for name in names
    ]


def _stranger(one: Stranger) -> Row:
    much = said(one.quantity, one.value)
    what = f"{one.visit or 'All visits'}: {spaced(one.quantity)} on {one.plate} differs by {much} from all others."
    return _personal(what, one.quantity, one.value, one.sd)


def _of_person(one: ConditionEffect, person: str) -> Row:
    value, sd = one.persons[person]
    much = said(one.quantity, value)
    text = f"{one.factor} {one.level} reads {much} more than {one.factor} {one.base}."
    return _personal(text, one.quantity, value, sd)


def _personal(text: str, quantity: str, value: float, sd: float) -> Row:
    known, interval = PLATE_QUANTITIES[quantity], [value - 1.96 * sd, value + 1.96 * sd]
    row = {"effect": known.effect, "target": known.target, "text": text, "quantity": quantity, "value": value, "sd": sd}
    return {**row, "ci95": interval, "unit": known.unit}


HARDLY = 0.5
"""Coefficients below which a size is the shipped one."""
NORM_ROW = Schema(
    "name value sd between_sessions_sd=between unit sessions observations",
    shown="what: {name} | usual: {value:.3g} | sd between sessions: {between_sessions_sd:.2g} | unit: {unit} | "
    "sessions: {sessions}",
)
"""What is usual of instruments, people and observations."""


def learned_document(found: LearnedLaboratory) -> Row:
    """Return what was learned: sessions, norms, and the sizes that changed most."""
    before = shipped()
    ratio = {
        key: size / before.size(key)
        for key, size in found.tolerances.sizes.items()
        if before.size(key) > 0 and found.shown.get(key, 0.0) >= HARDLY
    }
    most = sorted(ratio, key=lambda key: -max(ratio[key], 1 / ratio[key]))[:10]
    return {
        "sessions": list(found.sessions),
        "left_out": dict(found.left_out),
        "learned_utc": found.created,
        "norms": NORM_ROW.rows(found.norms),
        "changed_most": [
            {"key": key, "size": found.tolerances.size(key), "shipped": before.size(key), "values": found.shown[key]}
            for key in most
        ],
    }
