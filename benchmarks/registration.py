"""Registration measured: recordings cut into a marker file and a force file whose clock and place nobody knows, put
together again by `biodance register`, beside what the recording itself said.

    python -m benchmarks registration [--own 8] [--foreign 24] [--real] [--swap] [--first SEED]

The force file is made by ezc3d from the recording's own analog samples: corners turned by any yaw and moved by up to
3 m, samples cut so that the clocks differ by up to 2 s (a quarter of a short recording). ``--swap`` gives every marker
file the forces of the next recording: all of them must be refused.
"""

import argparse
import os
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

import biodance
from benchmarks.people import first_seed, session_of
from biodance.lab.c3d.write import write_c3d
from biodance.records import Markers, Plate

WALKS = "30A05 30A22 31A06 31A23 32A03 32A18 38A11 38A27 44A15 44A29 50A11 50A33 55A09 55A34"
REAL = (*(f"biomechzoo/HC0{n[:3]}/HC0{n}" for n in WALKS.split()), "adl_gait/2014001_C1_01", "pycgm/Movement_trial")
BARS = {"across_mm": 5.0, "along_mm": 10.0, "yaw_deg": 0.5, "delay_ms": 5.0}


@dataclass(frozen=True)
class Cut:
    """One recording in two files: ``markers``, ``forces``; the truth: ``plates`` in the room and ``delay`` s;
    ``forwards`` (2,) the direction in which the person faces.
    """

    name: str
    lab: str
    markers: Path
    forces: Path
    plates: tuple[Plate, ...]
    delay: float
    forwards: np.ndarray


def cut(source: Path, folder: Path, lab: str, rng: np.random.Generator) -> Cut:
    """Cut one C3D file in two; statics and session.toml are copied beside the markers."""
    trial = biodance.read_trial(source)
    assert trial.markers is not None
    times = trial.markers.time
    rate = trial.markers.rate
    per = round(trial.source.analog_rate / rate)
    most = min(2.0, 0.25 * times.size / rate)
    samples = round(rng.uniform(-most, most) * rate * per)
    frames = max(0, -(-samples // per))
    (folder / "markers").mkdir(parents=True)
    kept = Markers(trial.markers.names, times[frames:] - times[frames], trial.markers.xyz[frames:])
    measures = {key: value if "mass" in key.lower() else 1e3 * value for key, value in trial.measurements.items()}
    out = folder / "markers" / source.name
    write_c3d(out, markers=kept, parameters={"PROCESSING": dict(measures)} if measures else None)
    for other in source.parent.iterdir():
        words = other.stem.lower()
        beside = other.suffix == ".toml" or "static" in words or (words.endswith(("01", "_st")) and lab == "real")
        if beside and other.is_file() and other.name != source.name:
            shutil.copy(other, folder / "markers" / other.name)
    forces = folder / "forces.c3d"
    moved_forces(source, forces, frames * per - samples, per, rng)
    left, right = next(pair for pair in (("LASI", "RASI"), ("L_IAS", "R_IAS")) if pair[0] in trial.markers)
    aside = np.nanmean(trial.markers[left] - trial.markers[right], axis=0)[:2]
    ahead = np.array([aside[1], -aside[0]]) / np.linalg.norm(aside)
    return Cut(f"{source.parent.name}/{source.stem}", lab, out, forces, trial.plates, samples / per / rate, ahead)


def moved_forces(source: Path, out: Path, skip: int, per: int, rng: np.random.Generator) -> None:
    """Write the analog samples from number ``skip`` on, plates turned by any yaw and moved by up to 3 m."""
    file = ezc3d.c3d(str(source))
    analogs = file["data"]["analogs"][:, :, skip:]
    analogs = analogs[:, :, : analogs.shape[2] // per * per]
    yaw, shift = rng.uniform(-np.pi, np.pi), np.array([*rng.uniform(-3000, 3000, 2), 0.0])
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    plates = file["parameters"]["FORCE_PLATFORM"]["CORNERS"]
    corners = np.asarray(plates["value"])
    plates["value"] = np.einsum("ij,jkp->ikp", turn, corners) + shift[:, None, None]
    frames = analogs.shape[2] // per
    points = file["parameters"]["POINT"]
    for name in [key for key in points.keys() if key.startswith(("LABELS", "DESCRIPTIONS"))]:  # noqa: SIM118
        points[name]["value"] = ["NONE"] if name == "LABELS" else []
    if "TRIAL" in file["parameters"].keys():  # noqa: SIM118
        for name, frame in (("ACTUAL_START_FIELD", 1), ("ACTUAL_END_FIELD", frames)):
            file["parameters"]["TRIAL"][name]["value"] = np.array([frame, 0])
    file["data"]["points"] = np.full((4, 1, frames), np.nan)
    file["data"]["meta_points"]["residuals"] = -np.ones((1, 1, frames))
    file["data"]["meta_points"]["camera_masks"] = np.zeros((7, 1, frames), dtype=bool)
    file["data"]["analogs"] = analogs
    file["header"]["points"]["first_frame"] = 0
    file["header"]["points"]["last_frame"] = frames - 1
    file.write(str(out))


def measured(one: Cut, forces: Path) -> dict[str, Any]:
    """Return status, errors and intervals of one registration."""
    row: dict[str, Any] = {"name": one.name, "lab": one.lab}
    try:
        found = biodance.register(one.markers, forces)
    except biodance.BiodanceError as error:
        return row | {"status": "not done", "reason": str(error)[:200]}
    row |= {"status": found.status, "reason": found.reason[:200]}
    if found.pose is None or len(found.plates) != len(one.plates):  # forces of another laboratory
        return row
    error, sd = [], []
    for plate, true in zip(found.plates, one.plates, strict=True):
        if plate.loaded:
            side = true.corners[[0, 3]].mean(axis=0) - true.corners[[1, 2]].mean(axis=0)
            turn = np.angle(np.exp(1j * (plate.yaw - np.arctan2(side[1], side[0]))))
            error.append([*(1e3 * (plate.position - true.centre)), np.degrees(turn)])
            sd.append([*(1e3 * plate.sd), np.degrees(plate.yaw_sd)])
    mean, late, late_sd = np.mean(error, axis=0), 1e3 * (found.pose.delay - one.delay), 1e3 * found.delay_sd
    aside = np.array([-one.forwards[1], one.forwards[0]])
    values = (mean[:2] @ aside, mean[:2] @ one.forwards, mean[3], late)
    z = [*np.abs(np.array(error) / np.array(sd))[:, [0, 1, 3]].max(axis=0), abs(late) / late_sd]
    return row | {
        **{key: round(float(value), 3) for key, value in zip(BARS, values, strict=True)},
        "z": [round(float(x), 2) for x in z],
        "within": all(abs(value) <= bar for value, bar in zip(values, BARS.values(), strict=True)),
    }


def sources(asked: argparse.Namespace, work: Path) -> Iterator[tuple[Path, str]]:
    """Yield every recording and its laboratory."""
    for number in range(asked.own):
        place = session_of("own", asked.first + number, work, ("squat", "short")[number // 2 % 2])
        yield from ((path, "own") for path in sorted(place.glob("*.c3d")) if path.stem != "static")
    for number in range(asked.foreign):
        place = session_of("foreign", asked.first + number, work)
        for name in (f"dance0{1 + number % 6}", f"squat0{1 + number % 2}"):
            yield place / f"{name}.c3d", "foreign"
    for name in REAL if asked.real else ():
        yield Path(os.environ["BIODANCE_DATA"]) / f"{name}.c3d", "real"


def table(rows: list[dict[str, Any]]) -> str:
    """Return one line of Markdown for each laboratory."""
    lines = [
        "| recordings | registered | within all bars | refused | RMS across, along mm | yaw deg | delay ms | covered |"
    ]
    for lab in dict.fromkeys(row["lab"] for row in rows):
        mine = [row for row in rows if row["lab"] == lab]
        done = [row for row in mine if row["status"] == "registered"]
        told = [row for row in mine if "z" in row and "A second" not in row["reason"]]
        size = [float(np.sqrt(np.mean([row[key] ** 2 for row in told]))) for key in BARS] if told else [np.nan] * 4
        inside = np.mean([x < 1.96 for row in told for x in row["z"]]) if told else np.nan
        lines.append(
            f"| {lab} {len(mine)} | {len(done)} | {sum(row['within'] for row in done)} | {len(mine) - len(done)} | "
            f"{size[0]:.1f}, {size[1]:.1f} | {size[2]:.2f} | {size[3]:.1f} | {100 * inside:.0f} % |"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure, print a line for each recording and a table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--own", type=int, default=0, help="people of our own laboratory")
    ask.add_argument("--foreign", type=int, default=0, help="people of the foreign laboratory")
    ask.add_argument("--real", action="store_true")
    ask.add_argument("--swap", action="store_true")
    ask.add_argument("--first", type=int, default=first_seed())
    asked = ask.parse_args()
    rng, rows = np.random.default_rng(asked.first), []
    with tempfile.TemporaryDirectory() as made:
        work = Path(made)
        cuts = [cut(path, work / f"cut{k}", lab, rng) for k, (path, lab) in enumerate(sources(asked, work))]
        for k, one in enumerate(cuts):
            same = [c for c in cuts if c.lab == one.lab and c.name.split("/")[0] != one.name.split("/")[0]]
            rows.append(measured(one, same[k % len(same)].forces if asked.swap else one.forces))
            print(rows[-1] | {"reason": rows[-1].get("reason", "")[:100]}, flush=True)
    print(table(rows))
