"""What a diagnosis found, and what a movement will be able to see. Channels in the order Fx Fy Fz Mx My Mz."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from biodance.diagnosis.diagnosis import Estimate
from biodance.diagnosis.witness_evidence import ObservedEvidence, cause_visibilities
from biodance.display import spaced
from biodance.effects import Cause, DiscreteEffect
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS
from biodance.inference.foresight import TOLD, Foresight
from biodance.pipeline.results import SessionDiagnosis
from biodance.report.tables.schema import Row, Schema

if TYPE_CHECKING:
    from biodance.dance.expectation import Expectation


def _can_be_simulated(one: Cause) -> bool:
    from biodance.virtual_lab.causes import CAUSES

    return one.name in CAUSES


_PARAMETER = Schema("name unit typical")
CAUSE_ROW = Schema(
    "effect=name what=about.what",
    {
        "parameters": lambda one: [] if isinstance(one, DiscreteEffect) else _PARAMETER.rows(one.parameters),
        "can_be_simulated": _can_be_simulated,
    },
    "effect: {effect} | parameters: {told} | simulate: {simulated} | what it is: {what}",
)
"""A cause: parameters with unit and typical size ([] = it is there or not), and whether it can be simulated."""


def causes_shown(rows: Iterable[Row]) -> list[Row]:
    """Return the rows with what people see of parameters."""
    return [
        row
        | {
            "told": ", ".join(f"{one['name']} ({one['unit']})" for one in row["parameters"]) or "–",
            "simulated": "yes" if row["can_be_simulated"] else "no",
        }
        for row in rows
    ]


ATTENTION_ROW = Schema("level text trial about")
"""What a person must see, strongest first."""


def asks_nobody(attention: Iterable[Row]) -> bool:
    """Return whether nobody has to do anything about what must be seen: all of it are notes."""
    return all(row["level"] == "note" for row in attention)


JUDGED_ROW = Schema(
    "trial seconds left_out_s missed",
    {"why_not": lambda one: one.why_not or None, "left_out": lambda one: dict(one.left_out)},
)
"""Seconds that a verdict rests on, and why not the others; ``missed``: it should have; ``left_out`` s by reason."""
_ALIAS = Schema("effect target log_bayes_factor")
_GAIN = Schema("rms_before rms_after ci95 trials log_density_per_s=score log_density_se=score_se")
FINDING_ROW = Schema(
    "effect target probability visible_fraction changes advice trials",
    {
        "parameters": lambda one: _parameters(one.parameters),
        "set": _ALIAS,
        "gain": _GAIN,
        "session_entry": lambda one: one.cause.words.entry if one.cause.words else None,
    },
)
LIMIT_ROW = Schema(
    "effect target limit unit told_from typical",
    shown="cause: {effect:name} {target:name} | seen from: {limit:seen} | "
    "told from the others from: {told_from:seen} | typical: {typical:seen}",
)
"""From which size on a cause is seen; null: never."""
OBSERVED_ROW = Schema(
    "witness=observer what value sd unit expected expected_sd z trial counts",
    {"cause": lambda _: ""},
    "observer: {witness:name} | of what: {what} | trial: {trial} | value: {value:size} | "
    "expected: {expected:size} {expected_sd:±size} | z: {z:1}",
)
"""An observation; ``cause`` is the one to which it responds most, "" where to none."""
VISIBILITY_ROW = Schema(
    "effect target sd unit witnesses=observers would_be_seen_by=would",
    {"alike": lambda one: list(map(cause_name, one.alike))},
    "cause: {effect:name} {target:name} | seen to: {sd:±size} | seen by: {witnesses:name} | "
    "could also be: {alike:name}",
)
"""How well a cause was seen; an ``sd`` of null: nothing responds to it."""


def _parameters(found: Sequence[Estimate]) -> Row:
    """Return every parameter by name, and three axes (``shift_x`` ...) as a vector under the stem, too."""
    estimate = Schema("value sd unit ci95=interval")
    rows = {one.name: estimate.row(one) for one in found}
    for stem in [name.removesuffix("_x") for name in rows if name.endswith("_x")]:
        axes = [rows.get(f"{stem}_{axis}") for axis in "xyz"]
        if all(axes):
            rows[stem] = {key: [one[key] for one in axes if one] for key in ("value", "sd", "ci95")}
            rows[stem]["unit"] = rows[f"{stem}_x"]["unit"]
    return rows


def _masses(found: Identification | None) -> list[Row] | None:
    if found is None or found.status == "failed":
        return None
    # the mass is the first of the ten parameters of every segment
    sd = np.sqrt(np.diag(found.sip.covariance)[::10])
    columns = zip(found.sip.segments, found.sip.mass, sd, strict=True)
    return [{"name": name, "mass_kg": mass, "mass_sd_kg": s} for name, mass, s in columns]


def cause_name(names: Iterable[str]) -> str:
    """Return a cause as programs read it: its effect and, where it has one, its target."""
    return " ".join(names).strip()


def observed_rows(evidence: ObservedEvidence | None) -> list[Row]:
    """Return every observation."""
    if evidence is None:
        return []
    strongest = (cause_name(evidence.strongest(i)) for i in range(len(evidence.observations)))
    rows = OBSERVED_ROW.rows(evidence.observations)
    return [{**row, "cause": cause} for row, cause in zip(rows, strongest, strict=True)]


_DIAGNOSIS = Schema(
    "attention judged verdict told status probability notes",
    {
        "attention": ATTENTION_ROW,
        "judged": JUDGED_ROW,
        "reasons": lambda one: tuple(one.why),
        "findings": FINDING_ROW,
        "resembles": FINDING_ROW,
        "within_tolerance": FINDING_ROW.at("tolerated"),
        "gates": Schema("check ok text effect target size").at("checks"),
        "adequacy": Schema("channel band_hz z size unit matters trial around_s=second"),
        "unobservable": LIMIT_ROW,
        "limits": LIMIT_ROW,
        "candidates": _ALIAS,
        "witnesses": lambda one: observed_rows(one.witnesses),
        "witness_table": lambda one: VISIBILITY_ROW.rows(cause_visibilities(one.witnesses) if one.witnesses else ()),
    },
)


def diagnosis_document(found: SessionDiagnosis) -> Row:
    """Return all that the diagnosis found; null where a number is not finite (a limit of null: never seen)."""
    return {
        **_DIAGNOSIS.row(found.diagnosis),
        "gain": _GAIN.told(found.gain),
        "masses": {"before": _masses(found.before), "accepted": _masses(found.accepted)},
        "failures": found.failures,
    }


_SEATED = (
    "This dance is for somebody who sits: squats, hops, lunges and standing are not asked of that person. What "
    "concerns the plate and the cameras alone somebody else can do in their place."
)
CONFUSION_ROW = Schema(
    "log_bayes_factor=difference",
    {"cause": lambda pair: cause_name(pair.cause), "other": lambda pair: cause_name(pair.other)},
    "cause: {cause:name} | looks like: {other:name} | told by: {log_bayes_factor:1}",
)
"""Two causes that look alike, and the log Bayes factor that is expected to tell them apart."""


def foresight_summary(found: Foresight) -> str:
    """Return in two sentences what a movement will see and confuse."""
    mixed = sum(pair.difference < TOLD for pair in found.confusions)
    mixed_up = f"{mixed} of them {'looks' if mixed == 1 else 'look'} like another one"
    mixed_up = mixed_up if mixed else "all of them are told from each other"
    return (
        f"Of {len(found.limits)} causes that a diagnosis looks for, this movement will see {len(found.seen)} at their "
        f"typical size; {mixed_up}."
    )


_FORESIGHT = Schema(
    "limits separation",
    {
        "limits": LIMIT_ROW,
        "unobservable": LIMIT_ROW.at("hidden"),
        "confusions": CONFUSION_ROW,
        "summary": foresight_summary,
        "changes": Schema(
            "do",
            {
                "unseen": lambda one: list(map(cause_name, one.unseen)),
                "confused": lambda one: list(map(cause_name, one.confused)),
            },
        ),
    },
)


FIRST = 5
"""Changes that are told first."""


def seen_causes(found: Row) -> list[tuple[str, str]]:
    """Return effect and target of the causes that a movement will see at their typical size, of its document."""
    rows = (row for row in found["limits"] if row["limit"] is not None and row["limit"] <= row["typical"])
    return [(row["effect"], row["target"]) for row in rows]


def _learned(known: "Expectation | None") -> str:
    """Return in a sentence which masses a dance teaches, with their expected 95 % half-widths, kg."""
    if known is None:
        return ""
    rows = [
        f"{spaced(name)} ± {SIGMAS * after:.2g} kg ({SIGMAS * before:.2g})"
        for name, before, after in zip(known.segments, known.mass[0], known.mass[-1], strict=True)
        if after < 0.9 * before
    ]
    return f"Masses that it teaches (by the table alone): {', '.join(rows)}." if rows else "It teaches no mass."


def foresight_document(
    found: Foresight, *, seated: bool = False, plates: str = "", known: "Expectation | None" = None
) -> Row:
    """Return what a movement will be able to see; ``separation`` the smallest expected log Bayes factor between two
    causes it sees; ``care`` what must not be asked of whoever dances ``seated``; ``plates`` a sentence on how much
    plate the dance needs; ``learned`` one on the masses that become ``known``.
    """
    return _FORESIGHT.row(found) | {"care": _SEATED if seated else "", "plates": plates, "learned": _learned(known)}
