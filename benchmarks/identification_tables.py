"""Tables of docs/benchmarks/identification.md, from what bench_identification.py measured; means, medians and shares
only.
"""

from dataclasses import dataclass

import numpy as np

from biodance.identification.added_mass import LoadSearch
from biodance.identification.identification import Identification
from biodance.records import Array
from biodance.virtual_lab.truth import MERGED

SCALES = np.array([0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0])
LOADS = (0.5, 1.0, 2.4)
ARM = ("left_forearm_hand", 2.4)


@dataclass(frozen=True, eq=False)
class Row:
    """Everything measured on one subject's dance.

    ``error`` and ``squat`` by name of the estimate; ``cover`` (120,) in the model's frames, ``cover_own`` about the
    true joint centres; ``known`` (120,) verdict other than "cannot be known"; ``torque`` by "table", "identified" RMS
    error (n,) N·m in the squats and ``torque_cover`` (n,) share of frames whose band holds the true torque.
    """

    error: dict[str, Array]
    squat: dict[str, Array]
    cover: Array
    cover_own: Array
    known: Array
    unphysical: dict[str, int]
    status: tuple[str, str]
    evidence: Array
    held_out: Array
    from_data: float
    torque: dict[str, Array]
    torque_cover: Array
    joints: tuple[str, ...]


Load = tuple[str, float, LoadSearch, LoadSearch, Array]
"""Segment, kg, what is found with the reference and without, and the load's place (3,) m."""


SEGMENT_HEAD = (
    "| segment | mass kg: table, identified, paper | CoM mm: table, identified, paper "
    "| % covered: mass, first moment | % known: mass, CoM |",
    "|---|---|---|---|---|",
)


def accuracy_lines(rows: list[Row]) -> list[str]:
    """Return the tables of parameter errors, coverage and squats."""
    out = ["| | mass, kg | CoM, mm | inertia, % | segments that cannot exist |", "|---|---|---|---|---|"]
    for name in ("table", "identified", "paper"):
        e = np.array([r.error[name] for r in rows])
        bad = np.mean([r.unphysical[name] for r in rows])
        out.append(
            f"| {name} | {e[..., 0].mean():.3f} | {e[..., 1].mean():.1f} | {np.median(e[..., 2]):.0f} (median) | "
            f"{bad:.1f} of 12 |"
        )
    ratio = np.array([r.error["paper"].mean(axis=0) / r.error["identified"].mean(axis=0) for r in rows])
    gain = np.array([r.error["table"].mean(axis=0) / r.error["identified"].mean(axis=0) for r in rows])
    out += [
        "",
        f"Paper's programme over ours, median of subjects: mass {np.median(ratio[:, 0]):.1f} x, CoM "
        f"{np.median(ratio[:, 1]):.1f} x, "
        f"inertia {np.median(ratio[:, 2]):.1f} x. Table over ours: mass {np.median(gain[:, 0]):.2f} x, CoM "
        f"{np.median(gain[:, 1]):.2f} x, "
        f"inertia {np.median(gain[:, 2]):.2f} x.",
    ]
    status = [r.status for r in rows]
    out.append(
        f"Solved: ours {sum(a == 'solved' for a, _ in status)} of {len(rows)}; the paper's programme "
        f"{sum(b == 'solved' for _, b in status)} with its equalities, "
        f"{sum(b == 'solved without equalities' for _, b in status)} without."
    )
    out += ["", *SEGMENT_HEAD]
    for s, segment in enumerate(MERGED):
        m = [np.mean([r.error[n][s, 0] for r in rows]) for n in ("table", "identified", "paper")]
        c = [np.mean([r.error[n][s, 1] for r in rows]) for n in ("table", "identified", "paper")]
        cover = np.mean([r.cover[10 * s] for r in rows]), np.mean([r.cover[10 * s + 1 : 10 * s + 4] for r in rows])
        known = np.mean([r.known[10 * s] for r in rows]), np.mean([r.known[10 * s + 1 : 10 * s + 4] for r in rows])
        out.append(
            f"| {segment} | {m[0]:.2f} {m[1]:.2f} {m[2]:.2f} | {c[0]:.1f} {c[1]:.1f} {c[2]:.1f} "
            f"| {100 * cover[0]:.0f} {100 * cover[1]:.0f} | {100 * known[0]:.0f} {100 * known[1]:.0f} |"
        )
    return out


def coverage_lines(rows: list[Row]) -> list[str]:
    """Return the table of coverage of the 95 % intervals."""
    out = ["| truth | all | masses | first moments | inertias |", "|---|---|---|---|---|"]
    for words, cover in (
        ("in the model's frames", [r.cover for r in rows]),
        ("about the true joint centres", [r.cover_own for r in rows]),
    ):
        c = np.array(cover).reshape(-1, 10)
        out.append(
            f"| {words} | {100 * c.mean():.1f} % "
            f"| {100 * c[:, 0].mean():.1f} % | {100 * c[:, 1:4].mean():.1f} % | {100 * c[:, 4:].mean():.1f} % |"
        )
    out += [
        "",
        f"Share of the table's variance that the data remove, mean over parameters: "
        f"{100 * np.mean([r.from_data for r in rows]):.0f} %.",
    ]
    return out


def squat_lines(rows: list[Row]) -> list[str]:
    """Return the table of the squats that were not fitted."""
    norm = {
        n: np.array([[np.sqrt(np.mean(r.squat[n][:3] ** 2)), np.sqrt(np.mean(r.squat[n][3:] ** 2))] for r in rows])
        for n in rows[0].squat
    }
    out = ["| body | force, N (median) | moment, N·m (median) | Fx Fy Fz Mx My Mz (mean) |", "|---|---|---|---|"]
    for name, v in norm.items():
        channels = " ".join(f"{x:.1f}" for x in np.mean([r.squat[name] for r in rows], axis=0))
        out.append(f"| {name} | {np.median(v[:, 0]):.2f} | {np.median(v[:, 1]):.2f} | {channels} |")
    floor = norm["identified"] / norm["floor"]
    gain = norm["table"] / norm["identified"]
    low, high = np.percentile(gain, [10, 90], axis=0)
    out += [
        "",
        "Identified over floor (true parameters on the same kinematics), median: "
        f"force {np.median(floor[:, 0]):.2f}, moment {np.median(floor[:, 1]):.2f}. "
        f"Table over identified: force {np.median(gain[:, 0]):.2f} (10-90 %: {low[0]:.2f}-{high[0]:.2f}; paper 1.8), "
        f"moment {np.median(gain[:, 1]):.2f} ({low[1]:.2f}-{high[1]:.2f}; paper 2.5).",
    ]
    return out


def scale_lines(rows: list[Row]) -> list[str]:
    """Return the curve of evidence and of hold-out against the prior's scale."""
    evidence = np.sum([r.evidence for r in rows], axis=0)
    held = np.array([r.held_out for r in rows])
    out = ["| prior sd times | log evidence, all subjects | squat force, N | squat moment, N·m |", "|---|---|---|---|"]
    for i, scale in enumerate(SCALES):
        f, m = (np.median(np.sqrt(np.mean(held[:, i, cut] ** 2, axis=1))) for cut in (slice(0, 3), slice(3, 6)))
        out.append(f"| {scale:g} | {evidence[i] - evidence.max():.0f} | {f:.2f} | {m:.2f} |")
    return out


def pair_lines(nulls: list[LoadSearch], arms: list[Load]) -> list[str]:
    """Return what two sessions find, without and with 2.4 kg on the left forearm."""
    alarms = sum(n.found for n in nulls)
    p = np.array([n.p_no_load for n in nulls])
    right = [a.found and a.best.segment == ARM[0] for _, _, a, _, _ in arms]
    own = [next(x for x in a.suspects if x.segment == ARM[0]) for _, _, a, _, _ in arms]
    error = np.array([x.mass - ARM[1] for x in own])
    inside = [x.interval[0] <= ARM[1] <= x.interval[1] for x in own]
    place = np.array([1e3 * np.linalg.norm(x.place - a[4]) for x, a in zip(own, arms, strict=True)])
    return [
        f"- Unloaded pairs: {alarms} false alarms in {len(nulls)}; p of no load: median {np.median(p):.3f}, smallest "
        f"{p.min():.3f}.",
        f"- 2.4 kg on the left forearm: right segment in {sum(right)} of {len(arms)}; "
        f"error of the mass: median {np.median(abs(error)):.3f} kg, mean {error.mean():+.3f}, largest "
        f"{abs(error).max():.2f} kg; "
        f"the 95 % interval covers in {sum(inside)} of {len(inside)}; place: median {np.median(place):.0f} mm off.",
    ]


def load_lines(table: list[Load]) -> list[str]:
    """Return detection, localisation and size per segment and load."""
    out = [
        "| load on | kg | with reference: found, right segment, error kg, interval covers "
        "| one session: found, right segment, in the set |",
        "|---|---|---|---|",
    ]
    for segment in MERGED:
        for mass in LOADS:
            those = [(r, t) for s, m, r, t, _ in table if s == segment and m == mass]
            n = len(those)
            own = [next(x for x in r.suspects if x.segment == segment) for r, _ in those]
            covers = sum(x.interval[0] <= mass <= x.interval[1] for x in own)
            found, hit = sum(r.found for r, _ in those), sum(r.found and r.best.segment == segment for r, _ in those)
            size = np.median([abs(x.mass - mass) for x in own])
            alone, there = sum(t.found for _, t in those), sum(t.found and t.best.segment == segment for _, t in those)
            among = sum(segment in t.set for _, t in those)
            out.append(
                f"| {segment} | {mass:g} | {found}/{n}, {hit}/{n}, {size:.2f}, {covers}/{n} | {alone}/{n}, "
                f"{there}/{n}, {among}/{n} |"
            )
    return out


def torque_lines(rows: list[Row]) -> list[str]:
    """Return how far the torques of the kept squats are from those of the true parameters, and how often the bands
    hold them.
    """
    out = ["| joint | RMS error N·m: table, identified | band covers |", "|---|---|---|"]
    for j, name in enumerate(rows[0].joints):
        size = [np.sqrt(np.mean([r.torque[n][j] ** 2 for r in rows])) for n in ("table", "identified")]
        out.append(
            f"| {name} | {size[0]:.2f} {size[1]:.2f} | {100 * np.mean([r.torque_cover[j] for r in rows]):.0f} % |"
        )
    cover = 100 * np.mean([r.torque_cover for r in rows])
    return [
        *out,
        "",
        f"All joints: {cover:.1f} % of the true torques lie in their 95 % bands (same kinematics and ground wrenches).",
    ]


def standing_lines(found: list[Identification]) -> list[str]:
    """Return what quiet standing alone can know."""
    words = ("known", "partly known", "cannot be known")
    counts = np.array([[sum(k.verdict == w for k in f.known) for w in words] for f in found])
    kept = [k for f in found for k in f.known if k.verdict == "cannot be known"]
    ratio = np.median([k.sd / k.table_sd for k in kept])
    return [
        "Of 120 quantities: "
        f"{', '.join(f'{n:.0f} {w}' for n, w in zip(counts.mean(axis=0), words, strict=True))}; where it cannot know, "
        f"the "
        f"interval is {ratio:.2f} of the table's (median)."
    ]
