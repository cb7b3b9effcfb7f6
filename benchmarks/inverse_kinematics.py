"""Inverse kinematics beside OpenSim: the same body, markers, weights and limits, one thread, one run.

    OMP_NUM_THREADS=1 python -m benchmarks inverse_kinematics [--frames 6000] [--opensim-frames 300]

OpenSim's InverseKinematicsSolver starts every frame from the one before; its first frame is not timed. It runs with its
coordinates clamped to their ranges, at the default accuracy of its tool and at a finer one; the tool itself
runs with its defaults. Process CPU time counts; the solvers' reading of files does not. First the models are proven
equal: the same marker places at the same postures.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import opensim
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation, RotationSpline

from biodance.body.body import Body
from biodance.body.export import write_model
from biodance.body.human.human import human
from biodance.body.parts import UPRIGHT
from biodance.lab.readers.trc import write_trc
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import poses
from biodance.pipeline.program_folders import opensim_coordinates
from biodance.records import Array, Markers, Motion, Subject

RATE = 100.0
ACCURACIES = (1e-5, 1e-7)
"""The tool's default, and one that comes near the optimum."""
SOFT_TISSUE = (0.003, 2.0)
"""m, Hz: standard deviation and cut-off of the markers' slow wandering."""
CAMERA = 0.0003
"""m, standard deviation of white noise."""


def dance(body: Body, frames: int, *, seed: int = 0) -> Array:
    """Return q (frames, nq): postures held and moved between, a second each, the pelvis turning and travelling."""
    rng, at = np.random.default_rng(seed), np.arange(frames) / RATE
    knots = np.arange(0.0, at[-1] + 2.0)
    lower, upper = body.limits.lower, body.limits.upper
    share = 0.5 + 0.3 * rng.uniform(-1, 1, (len(knots) // 2 + 1, len(lower)))
    angles = PchipInterpolator(knots, np.repeat(lower + share * (upper - lower), 2, axis=0)[: len(knots)])(at)
    turn = RotationSpline(knots, Rotation.from_rotvec(rng.normal(0, 0.3, (len(knots), 3))))(at)
    place = CubicSpline(knots, rng.normal([0.0, 0.0, 0.95], 0.1, (len(knots), 3)))(at)
    return np.hstack([place, (turn * Rotation.from_quat(body.neutral[3:7])).as_quat(), angles])


def record(body: Body, q: Array, *, seed: int = 0) -> Markers:
    """Return the markers on wandering skin, as noisy cameras see them."""
    rng = np.random.default_rng(seed)
    xyz = poses(body, q).points(body.markers.segment, body.markers.position)
    soft = sosfiltfilt(butter(2, SOFT_TISSUE[1], fs=RATE, output="sos"), rng.normal(size=xyz.shape), axis=0)
    return Markers(
        body.markers.names,
        np.arange(len(q)) / RATE,
        xyz + soft * SOFT_TISSUE[0] / soft.std() + rng.normal(0, CAMERA, xyz.shape),
    )


def clamped(body: Body, path: Path) -> opensim.Model:
    """Return the body as OpenSim reads it, its coordinates clamped to their ranges."""
    model = opensim.Model(str(path))
    for joint in body.joints:
        model.updCoordinateSet().get(joint.name).setDefaultClamped(True)
    return model


def opensim_points(model: opensim.Model, body: Body, q: Array) -> Array:
    """Return OpenSim's marker places (T, K, 3) m in the lab frame at our postures."""
    state = model.initSystem()
    table = opensim_coordinates(
        body, Motion(np.arange(len(q)) / RATE, q, np.zeros((len(q), body.nv)), np.zeros((len(q), body.nv)))
    )
    out = np.empty((len(q), len(body.markers.names), 3))
    for t, values in enumerate(table.values):
        for name, value in zip(table.columns, values, strict=True):
            model.getCoordinateSet().get(name).setValue(state, float(value), False)
        model.realizePosition(state)
        out[t] = [model.getMarkerSet().get(name).getLocationInGround(state).to_numpy() for name in body.markers.names]
    return out @ UPRIGHT.T


def opensim_track(model: opensim.Model, body: Body, trc: Path, frames: int, accuracy: float) -> tuple[Array, float]:
    """Return OpenSim's marker places (frames, K, 3) m in the lab frame after tracking, and CPU seconds per frame."""
    state = model.initSystem()
    weights = opensim.SetMarkerWeights()
    for name, weight in zip(body.markers.names, body.markers.weight, strict=True):
        weights.cloneAndAppend(opensim.MarkerWeight(name, float(weight)))
    reference = opensim.MarkersReference(str(trc), weights)
    solver = opensim.InverseKinematicsSolver(model, reference, opensim.SimTKArrayCoordinateReference(), float("inf"))
    solver.setAccuracy(accuracy)
    state.setTime(0.0)
    solver.assemble(state)
    names, spent = body.markers.names, 0.0
    out = np.empty((frames, len(names), 3))
    for t in range(frames):
        state.setTime(t / RATE)
        before = time.process_time()
        solver.track(state)
        spent += (time.process_time() - before) if t else 0.0
        out[t] = [solver.computeCurrentMarkerLocation(name).to_numpy() for name in names]
    return out @ UPRIGHT.T, spent / (frames - 1)


def opensim_tool(folder: Path, body: Body, trc: Path, frames: int) -> float:
    """Return CPU seconds per frame of OpenSim's InverseKinematicsTool with its defaults, reading of files included."""
    tool = opensim.InverseKinematicsTool()
    tool.set_model_file(str(folder / "body.osim"))
    tool.setMarkerDataFileName(str(trc))
    tool.setStartTime(0.0)
    tool.setEndTime((frames - 1) / RATE)
    tool.setOutputMotionFileName(str(folder / "found.mot"))
    tool.setResultsDir(str(folder))
    for name, weight in zip(body.markers.names, body.markers.weight, strict=True):
        task = opensim.IKMarkerTask()
        task.setName(name)
        task.setWeight(float(weight))
        tool.upd_IKTaskSet().cloneAndAppend(task)
    before = time.process_time()
    tool.run()
    return (time.process_time() - before) / frames


def weighted_rms(body: Body, cost: Array) -> float:
    """Return mm from the weighted squared distances (T,) of the frames."""
    return float(1e3 * np.sqrt(cost.mean() / body.markers.weight.sum()))


def main() -> None:
    """Run and print."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--frames", type=int, default=6000)
    ask.add_argument("--opensim-frames", type=int, default=300)
    asked = ask.parse_args()
    ours, theirs = asked.frames, asked.opensim_frames
    body = human(Subject(58.3, 1.64, "F", 31.0))
    weight, q = body.markers.weight, dance(body, ours)
    markers = record(body, q)
    times = []
    for _ in range(3):
        before = time.process_time()
        found = solve_ik(body, markers)
        times.append((time.process_time() - before) / ours)
    own, cost = float(np.median(times)), found.residual[:theirs] ** 2 @ weight
    print(f"biodance: {1 / own:.0f} frames/s; {(found.status == 0).sum()} of {ours} frames solved")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = write_model(body, folder / "body.osim", format="osim", source="benchmark")
        few = q[:: max(1, ours // 20)]
        places = opensim_points(opensim.Model(str(path)), body, few)
        gap = np.abs(places - poses(body, few).points(body.markers.segment, body.markers.position)).max()
        print(f"models equal: markers of {len(few)} postures differ by at most {gap:.1e} m")
        first = Markers(markers.names, markers.time[:theirs], markers.xyz[:theirs])
        trc = write_trc(folder / "trial.trc", first)
        for accuracy in ACCURACIES:
            places, each = opensim_track(clamped(body, path), body, trc, theirs, accuracy)
            other = ((places - first.xyz) ** 2).sum(axis=2) @ weight
            print(
                f"OpenSim's solver, accuracy {accuracy:g}: {1 / each:.0f} frames/s, ratio {each / own:.0f}; weighted "
                f"RMS {weighted_rms(body, other):.5f} mm, biodance {weighted_rms(body, cost):.5f} mm, lower or equal "
                f"on {(cost <= other * (1 + 1e-9)).sum()} of {theirs} frames"
            )
        each = opensim_tool(folder, body, trc, theirs)
        print(f"OpenSim InverseKinematicsTool, defaults: {1 / each:.0f} frames/s, ratio {each / own:.0f}")
