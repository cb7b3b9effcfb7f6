"""The page docs/benchmarks/diagnosis.md and its figure from the scores of a run: every number with how many sessions
it rests on.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from diagnosis_gains import gain_demands, gain_lines, mass_lines
from diagnosis_scores import Score, share
from hidden_causes import Cause, truth
from hidden_sessions import REAL, Scenario

TWICE = 2.0
BAR = 10.0
"""s of a processor for one diagnosis."""


def page(scores: list[Score], *, run: str, figure: str, total: int) -> list[str]:
    """Return the page as lines; ``run`` names the version that was measured, ``total`` is the number of sessions in
    the full list.
    """
    groups: dict[str, list[Score]] = {}
    for one in scores:
        groups.setdefault(one.group, []).append(one)
    singles = [*groups.get("single", []), *groups.get("issue", [])]
    sections: dict[str, list[str]] = {
        "What was asked, what was measured": demands(groups, singles),
        "Causes one by one": cause_lines(singles),
        "Confusion": [f"![Which cause was named for which hidden one]({figure})", "", *confusion_lines(singles)],
        "Effects that no file describes": unknown_lines(groups.get("unknown", [])),
        "The culprit taken out of the family": absent_lines(groups.get("absent", [])),
        "Two causes at once": pair_lines(groups.get("pair", [])),
        "Checks before any statistics": check_lines(groups.get("discrete", [])),
        "What accepting the cause gains": gain_lines(groups.get("issue", [])),
        "What the fault does to the masses": mass_lines(groups.get("issue", [])),
        "Sessions without fault": null_lines(groups.get("null", [])),
        "Sessions without an answer": crash_lines(scores),
        "Real recordings with a fault written into a copy": real_lines(REAL),
    }
    seconds = np.array([one.seconds for one in scores if one.verdict != "crashed"])
    after = np.array([one.seconds - one.planned for one in scores if one.verdict != "crashed"])
    head = [
        "# Diagnosis of hidden effects",
        "",
        f"Protocol diagnosis (eight trials of ten seconds), {len(scores)} of the {total} sessions of the full list, "
        f"virtual subjects, each "
        f"written as C3D files, read, prepared, scaled, tracked and diagnosed through the public pipeline. Version "
        f"{run}. Made by "
        "`benchmarks/bench_diagnosis.py`.",
        f"Diagnosis of a session after reading and tracking: median {np.median(seconds):.1f} s of one processor, "
        f"largest "
        f"{np.max(seconds):.1f} s. Of that, what the movement alone decides (regressors, columns of all causes, "
        f"limits) takes "
        f"{np.median(seconds - after):.1f} s; what follows once forces are looked at: median {np.median(after):.1f} "
        f"s, largest "
        f"{np.max(after):.1f} s, at most {BAR:g} s in {share(after <= BAR)}. Two sessions were diagnosed at a time on "
        f"two processors: a "
        "session then takes half of these times on average.",
        "What is hidden is made by `biodance/virtual_lab`, which cannot import the effects: raw samples, corners and "
        "labels for "
        "instruments, a richer body (16 segments, soft tissue) for the person. The limit of a cause is what the "
        "diagnosis computes for "
        "that very session: for joint centres and markers with what placing the joints by movement has repaired or "
        "taken up before; for a "
        "longer thigh that of the knee's centre, because the static trial has measured the leg as a whole.",
    ]
    return [*head, *(line for title, lines in sections.items() if lines for line in ("", f"## {title}", *lines))]


def above(singles: list[Score]) -> list[Score]:
    """Return the sessions whose cause is at least twice its limit."""
    return [one for one in singles if one.ratio >= TWICE]


def below(singles: list[Score]) -> list[Score]:
    """Return the sessions whose cause is smaller than its limit."""
    return [one for one in singles if one.ratio < 1]


def alone(one: Score) -> bool:
    """Return whether every set that was given holds a hidden cause."""
    hidden = {name for same in truth(Scenario("", 0, 0, hidden=one.hidden)) for name in same}
    return all(hidden & set(some) for some in one.sets)


def demands(groups: dict[str, list[Score]], singles: list[Score]) -> list[str]:
    """Return the table of demands."""
    high, low, nulls, unknown, pairs = (
        above(singles),
        below(singles),
        *(groups.get(g, []) for g in ("null", "unknown", "pair")),
    )
    told = [one for one in high if one.told >= TWICE]
    after = [one.seconds - one.planned for some in groups.values() for one in some if one.verdict != "crashed"]
    sizes = [one.size_error for one in high if np.isfinite(one.size_error)]
    covered = [one.covered for one in high if one.covered is not None]
    rows = [
        ("false name or alarm in sessions without fault", "<= 5 %", share(not one.silent for one in nulls)),
        ("twice the limit or more: detected", ">= 98 %", share(not one.silent for one in high)),
        ("... exact name", ">= 90 %", share(one.exact[0] for one in high)),
        (
            "... exact name, and a verdict that stands by it (not unexplained)",
            "",
            share(o.exact[0] and o.verdict[:5] == "named" for o in high),
        ),
        (
            "... exact name, where also twice the size from which it is told from all others",
            "",
            share(one.exact[0] for one in told),
        ),
        ("... truth in the named set", ">= 95 %", share(one.within[0] for one in high)),
        ("... and nothing else named beside it", "", share(alone(one) for one in high)),
        (
            "... error of the size, median",
            "<= 10 %",
            f"{100 * np.median(sizes):.0f} % of {len(sizes)}" if sizes else "none measured",
        ),
        ("... 95 % interval covers", ">= 90 %", share(covered)),
        ("below the limit: wrong name", "<= 5 %", share(one.wrong for one in low)),
        ("no describing file: unexplained", ">= 90 %", share(one.verdict == "unexplained" for one in unknown)),
        ("no describing file: named, complete", "never", share(one.verdict == "named, complete" for one in unknown)),
        ("two causes: both named", ">= 85 %", share(all(one.exact) for one in pairs)),
        ("two causes: both in the sets", "", share(all(one.within) for one in pairs)),
        ("two causes: both named and nothing else", "", share(all(one.exact) and alone(one) for one in pairs)),
        *gain_demands(groups.get("issue", [])),
        (
            "diagnosis within 10 s of one processor, after what the movement alone decides",
            "all",
            share(s <= BAR for s in after),
        ),
        ("... time per session, two at a time on two processors", "all", share(s / 2 <= BAR for s in after)),
        (
            "sessions that gave no answer",
            "none",
            share(one.verdict == "crashed" for one in (one for some in groups.values() for one in some)),
        ),
    ]
    return ["| demand | bar | measured |", "|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in rows)]


def cause_lines(singles: list[Score]) -> list[str]:
    """Return one line per cause: what was said below, about and above the limit."""
    out = ["Named exactly (truth in the set) of so many sessions, by size over limit:", ""]
    out += ["| hidden | < 1 | 1 to 2 | >= 2 |", "|---|---|---|---|"]
    for name in dict.fromkeys(Cause(one.hidden[0], 0.0).name for one in singles):
        own = [one for one in singles if Cause(one.hidden[0], 0.0).name == name]
        cells = []
        for low, high in ((0.0, 1.0), (1.0, TWICE), (TWICE, np.inf)):
            some = [one for one in own if low <= one.ratio < high]
            cells.append(
                f"{sum(o.exact[0] for o in some)} ({sum(o.within[0] for o in some)}) of {len(some)}" if some else "-"
            )
        rest = [one for one in own if not np.isfinite(one.ratio)]
        if rest:
            cells[2] += (
                f"; without a limit {sum(o.exact[0] for o in rest)} ({sum(o.within[0] for o in rest)}) of {len(rest)}"
            )
        out.append(f"| {' '.join(name).strip()} | {' | '.join(cells)} |")
    return out


def confusion_lines(singles: list[Score]) -> list[str]:
    """Return what was named instead, above twice the limit."""
    missed = [one for one in above(singles) if not one.exact[0]]
    if not missed:
        return ["Above twice the limit nothing was confused."]
    out = ["Not named exactly at twice the limit or more:", ""]
    for one in missed:
        said = ", ".join(" ".join(name).strip() for name in one.names) or "nothing"
        where = " (truth in the set)" if one.within[0] else ""
        out.append(f"- {one.hidden[0]}, {one.ratio:.1f} x limit: {one.verdict}, {said}{where}")
    return out


def unknown_lines(unknown: list[Score]) -> list[str]:
    """Return the verdicts per unknown effect and size."""
    if not unknown:
        return []
    out = ["| effect | small | large |", "|---|---|---|"]
    for name in dict.fromkeys(one.hidden[0].partition(":")[0] for one in unknown):
        cells = []
        for level in ("small", "large"):
            some = [one for one in unknown if one.hidden[0].startswith(name) and one.level == level]
            cells.append("; ".join(f"{count} {verdict}" for verdict, count in Counter(map(_said, some)).items()) or "-")
        out.append(f"| {name} | {' | '.join(cells)} |")
    return out


def _said(one: Score) -> str:
    names = ", ".join(" ".join(name).strip() for name in one.names)
    return f"{one.verdict}" + (f" [{names}]" if names and one.verdict != "unexplained" else "")


def absent_lines(absent: list[Score]) -> list[str]:
    """Return the verdicts where the effect's file was taken out."""
    if not absent:
        return []
    said = Counter(one.verdict for one in absent)
    out = [f"{len(absent)} sessions: {'; '.join(f'{count} {verdict}' for verdict, count in said.items())}."]
    blamed = [f"- {one.hidden[0]}: {_said(one)}" for one in absent if one.verdict.startswith("named")]
    return [*out, "", *blamed] if blamed else out


def pair_lines(pairs: list[Score]) -> list[str]:
    """Return what was named for pairs."""
    return [f"- {' with '.join(one.hidden)}: {_said(one)}, {sum(one.exact)} of 2" for one in pairs]


def check_lines(discrete: list[Score]) -> list[str]:
    """Return what the checks named."""
    return [
        f"- {one.hidden[0]}: {_said(one)}" + ("" if any(one.exact) or any(one.within) else " (not found)")
        for one in discrete
    ]


def real_lines(table: Path) -> list[str]:
    """Return the table of bench_real_faults.py, if it was made."""
    if not table.is_file():
        return []
    return [
        "Two persons who stand still for 3 s, one who walks over the plates with 1.7 s of measured contact; the fault "
        "is in every file of "
        "the copy. Standing shows weights and places, no time; a fault below the limit that is computed for the "
        "recording stays unseen, as "
        "it must. The walk's markers lie 2.5 times as far from the body as where tolerances were learned, so nothing "
        "is named from it. "
        "Made by `benchmarks/bench_real_faults.py`.",
        "",
        *table.read_text().splitlines(),
    ]


def crash_lines(scores: list[Score]) -> list[str]:
    """Return the sessions that gave no answer and why."""
    return [
        f"- {one.key} ({' with '.join(one.hidden) or 'no fault'}): {one.note}"
        for one in scores
        if one.verdict == "crashed"
    ]


def null_lines(nulls: list[Score]) -> list[str]:
    """Return the false alarms."""
    if not nulls:
        return []
    people = len({one.subject for one in nulls})
    alarms = [
        f"- {one.key}: {_said(one)}, worst {one.worst[0]} z = {one.worst[1]:.1f}" for one in nulls if not one.silent
    ]
    worst = np.array([one.worst[1] for one in nulls])
    what = (
        f"{len(nulls)} sessions of {people} persons; z of what is left: median {np.median(worst):.1f}, largest "
        f"{worst.max():.1f}."
    )
    return [what, "", *alarms] if alarms else [what]


def draw(scores: list[Score], path: Path) -> None:
    """Draw which effect was named (columns) for which hidden one (rows), sessions at twice the limit or more."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    some = above([one for one in scores if one.group in ("single", "issue")])
    if not some:
        return
    hidden: Callable[[Score], str] = lambda one: one.hidden[0].partition(":")[0]  # noqa: E731
    named: Callable[[Score], str] = lambda one: one.names[0][0] if one.names else one.verdict  # noqa: E731
    rows = sorted({hidden(one) for one in some})
    columns = [*rows, *sorted({named(one) for one in some} - set(rows))]
    table = np.zeros((len(rows), len(columns)))
    for one in some:
        table[rows.index(hidden(one)), columns.index(named(one))] += 1
    share_of = table / table.sum(axis=1, keepdims=True)
    figure, axes = plt.subplots(figsize=(0.42 * len(columns) + 2.6, 0.36 * len(rows) + 2.2), layout="constrained")
    axes.imshow(share_of, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), count in np.ndenumerate(table):
        if count:
            axes.text(
                column,
                row,
                f"{count:.0f}",
                ha="center",
                va="center",
                color="white" if share_of[row, column] > 0.6 else "black",
                size=8,
            )
    axes.set_xticks(range(len(columns)), [c.replace("_", " ") for c in columns], rotation=60, ha="right", size=8)
    axes.set_yticks(range(len(rows)), [r.replace("_", " ") for r in rows], size=8)
    axes.set(xlabel="named first", ylabel="hidden", title=f"{len(some)} sessions, twice the limit or more")
    axes.title.set_size(9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)
