"""The figures of Bonnet et al. (2016) beside ours, of virtual persons: Fig. 5 (excitation over the dance), Fig. 8
(parameters with and without a load on the left forearm), Table II (squats that were not fitted).

    OMP_NUM_THREADS=1 python benchmarks/paper_figures.py FULL_DANCE.npz SHORT_DANCE.npz --sex F --height 1.55 --mass
    67.5 --seed 500 --work FOLDER --out docs/figures

Both sessions of Fig. 8 are of one virtual person who performs the short dance ("normal"); they are kept in the folder
--work. Fig. 5 is of the full dance as planned; the paper's is of its robot.
"""

import argparse
from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.excitation import dynamic_grams, excitation_blocks, static_grams, total, uprights
from biodance.identification.knowledge import SIGMAS
from biodance.lab.session.read import read_session
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.session import examine, identification_of
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.records import CHANNELS, Array, Subject
from biodance.virtual_lab.faults.causes import parse_cause
from biodance.virtual_lab.movement.dancing import PERFORMERS
from biodance.virtual_lab.recording.laboratory import LabVisit

GROUPS = {
    "head, arms, trunk": ("trunk_head", "upper_arm", "forearm_hand"),
    "right leg": ("right_thigh", "right_shank", "right_foot"),
    "left leg": ("left_thigh", "left_shank", "left_foot"),
}
LOAD = "added_mass:target=left_forearm_hand,mass=2.4"
_RATE, _LITTLE = 50.0, 0.01
PAPER = {
    "AT": ((9.5, 16.4, 41.9, 14.0, 6.6, 3.1), (0.37, 0.60, 0.96, 0.99, 0.79, 0.17)),
    "identified": ((5.8, 13.0, 18.9, 4.9, 3.4, 1.5), (0.54, 0.64, 0.98, 0.99, 0.81, 0.43)),
}
"""Table II of the paper, human: RMS (N, N·m) and correlation of Fx Fy Fz Mx My Mz."""


def curves(dance: Dance) -> dict[str, tuple[Array, Array]]:
    """Return for every group the static criterion after each posture (P,) and the dynamic one after each move (K,),
    over their bounds: 1 is the least possible.
    """
    parts, body = excitation_blocks(dance.body), dance.body
    every = list(range(len(body.segments)))
    holds = [phase for phase in dance.phases if phase.kind == "hold" and phase.stance.over is None]
    ups = np.concatenate([uprights(dance.state(phase, np.array([phase.start]))) for phase in holds])
    gram, grams = np.tile(_LITTLE * np.eye(6), (len(every), 1, 1)), []
    for phase in (phase for phase in dance.phases if phase.kind == "move"):
        time = np.linspace(phase.start, phase.end, round((phase.end - phase.start) * _RATE) + 1)
        gram = gram + dynamic_grams(dance.state(phase, time), every) / _RATE
        grams.append(gram)
    out = {}
    for group, names in GROUPS.items():
        weight = np.where([any(name in segment for name in names) for segment in body.segments], parts.weight, 0.0)
        bounds = [weight[[bool(pick) for pick in picks]].sum() for picks in (parts.first, parts.second)]
        static = [total(weight, static_grams(ups[:k]), parts.first)[0] for k in range(2, len(ups) + 1)]
        dynamic = [total(weight, one, parts.second)[0] for one in grams]
        out[group] = np.array(static) / bounds[0], np.array(dynamic) / bounds[1]
    return out


def draw_excitation(dance: Dance, path: Path) -> None:
    """Draw Fig. 5: criterion over its bound, logarithmic, static and dynamic, for head-arms-trunk and each leg."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.1, 4.2), layout="constrained")
    grid = drawn.subplots(2, 3, sharey="row")
    for column, (group, (static, dynamic)) in enumerate(curves(dance).items()):
        for axes, values, first in ((grid[0, column], static, 2), (grid[1, column], dynamic, 1)):
            axes.semilogy(np.arange(first, first + len(values)), values, color="#0072B2")
            axes.text(0.95, 0.88, f"ends at {values[-1]:.2f}", transform=axes.transAxes, ha="right")
            axes.grid(color="#DDDDDD", linewidth=0.5)
        grid[0, column].set_title(group)
        grid[0, column].set_xlabel("postures")
        grid[1, column].set_xlabel("moves")
    grid[0, 0].set_ylabel("static criterion / bound")
    grid[1, 0].set_ylabel("dynamic criterion / bound")
    drawn.savefig(path, dpi=130, metadata={"Software": None})


def draw_parameters(bare: SessionIdentification, loaded: SessionIdentification, path: Path) -> None:
    """Draw Fig. 8: mass, centre of mass along the segment and one moment of inertia, table and identified without and
    with the load, with 95 % intervals.
    """
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.1, 4.6), layout="constrained")
    segments = bare.identification.sip.segments
    place = np.arange(len(segments))[::-1]
    panels = (("mass", 1.0, "mass (kg)"), ("com y", 1000.0, "CoM along segment (mm)"), ("Ixx", 1.0, "Ixx (kg·m²)"))
    for axes, (quantity, factor, title) in zip(drawn.subplots(1, 3, sharey=True), panels, strict=True):
        for one, colour, shift, name in (
            (bare, "#0072B2", 0.0, "identified"),
            (loaded, "#D55E00", -0.25, "with 2.4 kg"),
        ):
            rows = [k for k in one.identification.known if k.quantity == quantity]
            value, sd = (factor * np.array([getattr(k, what) for k in rows]) for what in ("value", "sd"))
            axes.errorbar(value, place + shift, xerr=SIGMAS * sd, fmt="o", ms=3.5, lw=1.3, color=colour, label=name)
            if one is bare:
                table = factor * np.array([k.table for k in rows])
                axes.plot(table, place + 0.25, "s", ms=4, mfc="white", color="#555555", label="table")
        axes.set_xlabel(title)
        if quantity != "com y":
            axes.set_xscale("log")
        axes.grid(axis="x", color="#DDDDDD", linewidth=0.5)
    drawn.axes[0].set_yticks(place, [name.replace("_", " ") for name in segments])
    drawn.legend(*drawn.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    drawn.savefig(path, dpi=130, metadata={"Software": None})


def table(one: SessionIdentification) -> str:
    """Return Table II as Markdown: paper's and ours, means over the squats that were not fitted."""
    ours = {
        which: [
            np.mean([getattr(getattr(v, f"{name}_agreement"), what) for v in one.validations], axis=0)
            for what in ("rms", "correlation")
        ]
        for which, name in (("AT", "table"), ("identified", "identified"))
    }
    lines = [
        "| channel | paper: table, RMS (CC) | paper: identified | ours: table | ours: identified |",
        "|---|---|---|---|---|",
    ]
    for k, channel in enumerate(CHANNELS):
        cells = [f"{who[which][0][k]:.1f} ({who[which][1][k]:.2f})" for who in (PAPER, ours) for which in PAPER]
        lines.append(f"| {channel} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Draw and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("full", "short"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--sex", default="F")
    for name, kind in (("height", float), ("mass", float), ("seed", int), ("work", Path), ("out", Path)):
        parser.add_argument(f"--{name}", type=kind, required=True)
    chosen = parser.parse_args()
    draw_excitation(Dance.load(chosen.full), chosen.out / "paper_excitation.png")
    who, dance, found = Subject(chosen.mass, chosen.height, chosen.sex), Dance.load(chosen.short), []
    for number, hidden in enumerate(((), (parse_cause(LOAD),))):
        place = chosen.work / f"visit_{number}"
        if not (place / "truth").is_dir():
            simulate_dance(
                who,
                dance,
                place,
                seed=chosen.seed,
                performer=PERFORMERS["normal"],
                hidden=hidden,
                visit=LabVisit(number),
            )
        before = found[0] if found else None
        found.append(identification_of(examine(read_session(place), reference=before)))
    draw_parameters(*found, chosen.out / "paper_parameters.png")
    print(table(found[0]))
    best = found[1].search.best
    print(f"load: {best.segment} {best.mass:.2f} kg {best.interval}, p_none {found[1].search.p_no_load:.2g}")


if __name__ == "__main__":
    main()
