"""The paper's figures 12 and 13 of a robot: drawing, truth and identified links; the wrench of the motion kept.

    python benchmarks/robot_figures.py RECORDING DONE hoap3.urdf OUT

RECORDING and its .truth.json by `bench_robot_recording.py record`, DONE by `biodance identify`.
"""

import json
import sys
from pathlib import Path

import numpy as np
from bench_robot import quantities
from bench_robot_recording import FEET

from biodance.body.body_file import read_body
from biodance.body.robot.urdf import read_urdf
from biodance.lab.robot.recording import read_robot_recording
from biodance.motion.clocks import fit_plate, onto_plate
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.robot_trials import bring_together
from biodance.records import CHANNELS, Wrench

_COLOURS = {"drawn": "#999999", "identified": "#0072B2", "true": "#D55E00"}


def draw_links(phi: dict[str, "np.ndarray"], names: tuple[str, ...], path: Path) -> None:
    """Draw Fig. 12: mass, the three coordinates of the CoM and the three moments of inertia of every link."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.1, 8.5), layout="constrained")
    grid = drawn.subplots(7, 1, sharex=True)
    labels = ["mass (kg)", *(f"CoM {a} (mm)" for a in "xyz"), *(f"I{a}{a} (kg·m²)" for a in "xyz")]
    for k, (who, values) in enumerate(phi.items()):
        mass, com, inertia = quantities(values)
        rows = [mass, *(1000 * com).T, *inertia.T]
        for axes, row, label in zip(grid, rows, labels, strict=True):
            axes.bar(np.arange(len(row)) + 0.27 * (k - 1), row, 0.25, color=_COLOURS[who], label=who)
            axes.set_ylabel(label, fontsize=7)
            axes.grid(axis="y", color="#DDDDDD", linewidth=0.5)
    words = [name.replace("_", " ") for name in names]
    grid[-1].set_xticks(range(len(names)), words, rotation=40, ha="right", fontsize=7)
    drawn.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    drawn.savefig(path, dpi=130, metadata={"Software": None})


def draw_wrench(time: "np.ndarray", rows: dict[str, "np.ndarray"], use: "np.ndarray", path: Path) -> None:
    """Draw Fig. 13: the six channels of the motion kept, about the first standing sole."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.1, 6.5), layout="constrained")
    for axes, c in zip(drawn.subplots(3, 2, sharex=True).T.ravel(), range(6), strict=True):
        for (who, value), colour in zip(rows.items(), ("#000000", "#999999", "#0072B2"), strict=True):
            axes.plot(time, np.where(use, value[:, c], np.nan), color=colour, lw=0.9, label=who)
        axes.set_ylabel(f"{CHANNELS[c]} ({'N' if c < 3 else 'N·m'})")
        axes.grid(color="#DDDDDD", linewidth=0.5)
    drawn.axes[2].set_xlabel("s")
    drawn.axes[5].set_xlabel("s")
    drawn.legend(*drawn.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    drawn.savefig(path, dpi=130, metadata={"Software": None})


def main(recording: str, done: str, urdf: str, out: str) -> None:
    """Draw both."""
    body, folder = read_urdf(urdf, feet=FEET), Path(out)
    identified, _ = read_body(Path(done) / "body.json")
    truth = np.array(json.loads(Path(recording + ".truth.json").read_text())["phi"])
    phi = {"drawn": body.sip.phi, "true": truth, "identified": identified.sip.phi}
    draw_links(phi, body.segments, folder / "robot_links.png")
    trials, _ = bring_together(body, read_robot_recording(recording, tuple(joint.name for joint in body.joints)))
    one = next(trial for trial in trials if trial.recorded.role == "validate")
    time = one.motion.fit.motion.time
    measured = onto_plate(one.motion.fit.wrench.value, one.plate)
    rows = {"measured": measured}
    for who, robot in (("drawn", body), ("identified", identified)):
        needed = predict_wrench(robot, one.motion.fit.motion)
        rows[who] = onto_plate(
            needed.value, fit_plate(needed, Wrench(time, measured), one.motion.grounded.use, within=0.3)
        )
    draw_wrench(time, rows, one.motion.fit.use, folder / "robot_wrench.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
