"""The part of docs/diagnosis.md on what accepting a named cause gains: forces and moments of kept trials, and the identified masses."""

import numpy as np
from diagnosis_scores import Score, share

CLEAN = 1.2
"""Largest ratio of mass errors, cause accepted over without fault."""


def gain_demands(issue: list[Score]) -> list[tuple[str, str, str]]:
    """Return the rows on what accepting the cause gains."""
    proven = [one.gain["ci95"][0] > 0 for one in issue if "ci95" in one.gain]
    ratios = [_ratio(one) for one in issue if np.isfinite(_ratio(one))]
    back = f"; median {np.median(ratios):.2f}" if ratios else ""
    return [
        ("faults of the issue: named, so that a gain is measured", "", share("ci95" in one.gain for one in issue)),
        ("... interval of the gain excludes zero", "all", share(proven)),
        (f"... error of the masses within {CLEAN:g} x of fault-free", "all", share(ratio <= CLEAN for ratio in ratios) + back),
    ]


def _ratio(one: Score) -> float:
    """Return the error of the masses with the cause accepted over that without fault; NaN where nothing was accepted."""
    errors = one.gain.get("mass_error", {})
    return errors["accepted"] / errors["fault_free"] if {"accepted", "fault_free"} <= set(errors) else float("nan")


def gain_lines(issue: list[Score]) -> list[str]:
    """Return the gains on squats that were not fitted, where trials were kept."""
    judged = [one for one in issue if "before" in one.gain]
    if not judged:
        return []
    out = [
        "Root mean square over the squats, mean of three channels: left by the table's body, by the body identified with the fault in the "
        "data, and once the cause is accepted; 95 % interval of the share that accepting removes of the second.",
        "",
        "| hidden | person | verdict | force, N | moment, N·m | removed |",
        "|---|---|---|---|---|---|",
    ]
    for one in sorted(judged, key=lambda one: one.hidden):
        three = [np.array(one.gain[key]) for key in ("table", "before", "after") if one.gain.get(key)]
        force, moment = (" -> ".join(f"{_mean(rms[part]):.2f}" for rms in three) for part in (slice(0, 3), slice(3, 6)))
        low, high = one.gain["ci95"]
        out.append(f"| {one.hidden[0]} | {one.subject} | {one.verdict} | {force} | {moment} | {100 * low:.0f} to {100 * high:.0f} % |")
    return out


def mass_lines(issue: list[Score]) -> list[str]:
    """Return the errors of the segment masses with the fault, with its cause accepted and without fault."""
    known = [one for one in issue if "mass_error" in one.gain]
    if not known:
        return []
    out = [
        "Mean relative error of the twelve segment masses, in per cent; the last column is the error with the cause accepted over that of "
        "the same person, movement and instruments without fault.",
        "",
        "| hidden | person | table | with the fault | cause accepted | without fault | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in sorted(known, key=lambda one: one.hidden):
        errors = one.gain["mass_error"]
        cells = [f"{100 * errors[key]:.1f}" if key in errors else "not named" for key in ("table", "sip_alone", "accepted", "fault_free")]
        ratio = f"{_ratio(one):.2f}" if np.isfinite(_ratio(one)) else "-"
        out.append(f"| {one.hidden[0]} | {one.subject} | {' | '.join(cells)} | {ratio} |")
    return out


def _mean(rms: np.ndarray) -> float:
    return float(np.sqrt(np.mean(rms**2)))
