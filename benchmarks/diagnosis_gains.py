"""The part of docs/benchmarks/diagnosis.md on what accepting a cause gains: forces, moments of kept trials, and
masses.
"""

import numpy as np
from diagnosis_scores import Score, share

CLEAN = 1.2
"""Largest ratio of mass errors, cause accepted over without fault."""


def gain_demands(issue: list[Score]) -> list[tuple[str, str, str]]:
    """Return the rows on what accepting the cause gains."""
    proven = [one.gain["ci95"][0] > 0 for one in issue if "ci95" in one.gain]
    pairs = [two for one in issue if np.isfinite(two := ratios(one)).all()]
    back = f"; median {np.median([kg for kg, _ in pairs]):.2f}" if pairs else ""
    return [
        ("faults of the issue: named, so that a gain is measured", "", share("ci95" in one.gain for one in issue)),
        ("... interval of the gain excludes zero", "all", share(proven)),
        (
            f"... error of the masses (kg) within {CLEAN:g} x of fault-free",
            "all",
            share(kg <= CLEAN for kg, _ in pairs) + back,
        ),
        (
            f"... relative error of the masses within {CLEAN:g} x of fault-free",
            "all",
            share(part <= CLEAN for _, part in pairs),
        ),
    ]


def errors(one: Score, body: str) -> tuple[float, float]:
    """Return the mean error of the twelve segment masses of a ``body``, kg, and relative to each segment's own; NaN
    where unknown.
    """
    masses = one.gain.get("masses", {})
    if body not in masses:
        return float("nan"), float("nan")
    away, true = np.abs(np.array(masses[body]) - np.array(masses["true"])), np.array(masses["true"])
    return float(away.mean()), float((away / true).mean())


def ratios(one: Score) -> tuple[float, float]:
    """Return both errors with the cause accepted over those without fault; NaN where nothing was accepted."""
    accepted, clean = errors(one, "accepted"), errors(one, "fault_free")
    return accepted[0] / clean[0], accepted[1] / clean[1]


def gain_lines(issue: list[Score]) -> list[str]:
    """Return the gains on squats that were not fitted, where trials were kept."""
    judged = [one for one in issue if "before" in one.gain]
    if not judged:
        return []
    out = [
        "Root mean square over the squats, mean of three channels: left by the table's body, by the body identified "
        "with the fault in the "
        "data, and once the cause is accepted; 95 % interval of the share that accepting removes of the second.",
        "",
        "| hidden | person | verdict | force, N | moment, N·m | removed |",
        "|---|---|---|---|---|---|",
    ]
    for one in sorted(judged, key=lambda one: one.hidden):
        three = [np.array(one.gain[key]) for key in ("table", "before", "after") if one.gain.get(key)]
        force, moment = (" -> ".join(f"{_mean(rms[part]):.2f}" for rms in three) for part in (slice(0, 3), slice(3, 6)))
        low, high = one.gain["ci95"]
        out.append(
            f"| {one.hidden[0]} | {one.subject} | {one.verdict} | {force} | {moment} | {100 * low:.0f} to "
            f"{100 * high:.0f} % |"
        )
    return out


def mass_lines(issue: list[Score]) -> list[str]:
    """Return the errors of the segment masses with the fault, with its cause accepted and without fault."""
    known = [one for one in issue if "masses" in one.gain]
    if not known:
        return []
    out = [
        "Mean error of the twelve segment masses, in kg and relative to each segment's mass (the feet of 0.7 kg rule "
        "the latter); the last "
        "column is the error with the cause accepted over that of the same person, movement and instruments without "
        "fault.",
        "",
        "| hidden | person | table | with the fault | cause accepted | without fault | ratio kg, relative |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in sorted(known, key=lambda one: one.hidden):
        cells = [_said(*errors(one, body)) for body in ("table", "sip_alone", "accepted", "fault_free")]
        kg, part = ratios(one)
        both = f"{kg:.2f}, {part:.2f}" if np.isfinite(kg) else "-"
        out.append(f"| {one.hidden[0]} | {one.subject} | {' | '.join(cells)} | {both} |")
    return out


def _said(kg: float, part: float) -> str:
    return f"{kg:.2f} kg, {100 * part:.0f} %" if np.isfinite(kg) else "not named"


def _mean(rms: np.ndarray) -> float:
    return float(np.sqrt(np.mean(rms**2)))
