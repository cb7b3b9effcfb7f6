"""What the visits of a laboratory say of its plates, under keys whose unit is their suffix or stands beside them."""

from typing import Any

from biodance.diagnosis.archive.changes import Change, Stranger
from biodance.diagnosis.archive.conditions import ConditionEffect
from biodance.diagnosis.archive.judge import PlateCard, PlateFinding, PlateLevel, said
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES
from biodance.pipeline.plates import PlatesJudged
from biodance.report.documents.plain import keyed


def plates_document(found: PlatesJudged) -> dict[str, Any]:
    """Return all that was found: a card per plate, persons, what all share, and what was left out; null where nothing
    tells a quantity.
    """
    judged = found.judgement
    return {
        "archive": found.archive.resolve().name,
        "visits": [keyed(one, "visit=name person") | {"date": one.date or None} for one in judged.visits],
        "plates": [_card(card) for card in judged.plates],
        "persons": _persons(found),
        "common": [_common(one) for one in judged.conditions],
        "attention": [
            {"level": "warn", "text": f"{card.plate}: {one.text}", "trial": "", "about": one.effect}
            for card in judged.plates
            for one in card.findings
        ],
        "refused": dict(found.refused),
        "notes": list(found.notes),
    }


def _card(card: PlateCard) -> dict[str, Any]:
    levels = {one.quantity: one for one in card.levels}

    def of(names: tuple[str, ...], attribute: str) -> list[float | None]:
        return [getattr(levels.get(name), attribute, None) for name in names]

    place, offset = ("place_x", "place_y"), ("offset_x", "offset_y", "offset_z")
    seen = [levels[name].taken_off for name in offset if name in levels]
    return {
        **keyed(card, "plate visits"),
        "place_m": of(place, "value"),
        "place_sd_m": of(place, "sd"),
        **keyed(levels.get("gain"), "gain=value gain_sd=sd"),
        "offset_n": of(offset, "value"),
        "offset_sd_n": of(offset, "sd"),
        "offset_taken_off": min(seen) if seen else None,
        **keyed(levels.get("delay"), "delay_s=value delay_sd_s=sd"),
        "levels": [_with_unit(one, "quantity value sd between_visits_sd=between visits") for one in card.levels],
        "changes": [_change(one) for one in card.changes],
        "findings": [_with_unit(one, "effect target text quantity value ci95=interval") for one in card.findings],
    }


def _with_unit(one: PlateLevel | PlateFinding | Change, keys: str) -> dict[str, Any]:
    return keyed(one, keys) | {"unit": PLATE_QUANTITIES[one.quantity].unit}


def _change(one: Change) -> dict[str, Any]:
    """Return a change; ``ci95`` of the step, ``date`` of the first visit after it."""
    return {
        "date": one.visit.date or None,
        "visit": one.visit.name,
        "earliest": one.earliest.date or one.earliest.name,
        "latest": one.latest.date or one.latest.name,
        **_with_unit(one, "plate quantity before after ci95=interval"),
        "matters": one.matters,
    }


def _persons(found: PlatesJudged) -> list[dict[str, Any]]:
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


def _stranger(one: Stranger) -> dict[str, Any]:
    known = PLATE_QUANTITIES[one.quantity]
    text = (
        f"{one.visit or 'All visits'}: {one.quantity.replace('_', ' ')} on {one.plate} differs by "
        f"{said(one.quantity, one.value)} from all others."
    )
    return _row(known.effect, known.target, text, one.quantity, one.value, one.sd)


def _of_person(one: ConditionEffect, person: str) -> dict[str, Any]:
    known, (value, sd) = PLATE_QUANTITIES[one.quantity], one.persons[person]
    text = f"{one.factor} {one.level} reads {said(one.quantity, value)} more than {one.factor} {one.base}."
    return _row(known.effect, known.target, text, one.quantity, value, sd)


def _row(effect: str, target: str, text: str, quantity: str, value: float, sd: float) -> dict[str, Any]:
    interval = [value - 1.96 * sd, value + 1.96 * sd]
    row = {"effect": effect, "target": target, "text": text, "quantity": quantity, "value": value, "sd": sd}
    return {**row, "ci95": interval, "unit": PLATE_QUANTITIES[quantity].unit}


def _common(one: ConditionEffect) -> dict[str, Any]:
    return {
        **keyed(one, "plate quantity factor level base value=shared.mean ci95=shared.interval"),
        "between_persons_sd": one.shared.spread,
        "unit": PLATE_QUANTITIES[one.quantity].unit,
        "persons": len(one.visits),
        "persons_named": sorted(one.persons),
    }
