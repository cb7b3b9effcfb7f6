"""What the visits of a laboratory say of its plates, under keys whose unit is their suffix or stands beside them."""

from typing import Any

from biodance.diagnosis.archive.changes import Change, Stranger
from biodance.diagnosis.archive.conditions import ConditionEffect
from biodance.diagnosis.archive.judge import PlateCard, PlateFinding, PlateLevel, said
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES
from biodance.pipeline.plates import PlatesJudged


def plates_document(found: PlatesJudged) -> dict[str, Any]:
    """Return all that was found: a card per plate, persons, what all share, and what was left out; null where nothing
    tells a quantity.
    """
    judged = found.judgement
    return {
        "archive": found.archive.resolve().name,
        "visits": [{"visit": one.name, "person": one.person, "date": one.date or None} for one in judged.visits],
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

    def value(*names: str) -> list[float | None]:
        return [levels[name].value if name in levels else None for name in names]

    def error(*names: str) -> list[float | None]:
        return [levels[name].sd if name in levels else None for name in names]

    gain, delay, offset = levels.get("gain"), levels.get("delay"), ("offset_x", "offset_y", "offset_z")
    seen = [levels[name].taken_off for name in offset if name in levels]
    return {
        "plate": card.plate,
        "visits": card.visits,
        "place_m": value("place_x", "place_y"),
        "place_sd_m": error("place_x", "place_y"),
        "gain": gain.value if gain else None,
        "gain_sd": gain.sd if gain else None,
        "offset_n": value(*offset),
        "offset_sd_n": error(*offset),
        "offset_taken_off": min(seen) if seen else None,
        "delay_s": delay.value if delay else None,
        "delay_sd_s": delay.sd if delay else None,
        "levels": [_level(one) for one in card.levels],
        "changes": [_change(one) for one in card.changes],
        "findings": [_finding(one) for one in card.findings],
    }


def _level(one: PlateLevel) -> dict[str, Any]:
    return {
        "quantity": one.quantity,
        "value": one.value,
        "sd": one.sd,
        "between_visits_sd": one.between,
        "visits": one.visits,
        "unit": PLATE_QUANTITIES[one.quantity].unit,
    }


def _change(one: Change) -> dict[str, Any]:
    """Return a change; ``ci95`` of the step, ``date`` of the first visit after it."""
    return {
        "date": one.visit.date or None,
        "visit": one.visit.name,
        "earliest": one.earliest.date or one.earliest.name,
        "latest": one.latest.date or one.latest.name,
        "plate": one.plate,
        "quantity": one.quantity,
        "before": one.before,
        "after": one.after,
        "ci95": list(one.interval),
        "unit": PLATE_QUANTITIES[one.quantity].unit,
        "matters": one.matters,
    }


def _finding(one: PlateFinding) -> dict[str, Any]:
    return {
        "effect": one.effect,
        "target": one.target,
        "text": one.text,
        "quantity": one.quantity,
        "value": one.value,
        "ci95": list(one.interval),
        "unit": PLATE_QUANTITIES[one.quantity].unit,
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
        "plate": one.plate,
        "quantity": one.quantity,
        "factor": one.factor,
        "level": one.level,
        "base": one.base,
        "value": one.shared.mean,
        "ci95": list(one.shared.interval),
        "between_persons_sd": one.shared.spread,
        "unit": PLATE_QUANTITIES[one.quantity].unit,
        "persons": len(one.visits),
        "persons_named": sorted(one.persons),
    }
