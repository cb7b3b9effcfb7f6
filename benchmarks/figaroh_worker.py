"""Run by bench_identification_peers.py with the Python of a virtual environment that holds figaroh 1.0.2; imports
nothing of biodance.

Reads problem.npz (W (m, p) with rows in time, wrench (m,), prior (p,), segments; q, v, a of some frames) and
model.urdf; writes answer.json.
"""

import json
import sys
import time
import warnings
from pathlib import Path

import numpy as np

warnings.simplefilter("ignore")
KEYS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def default_workflow(folder: Path, problem) -> str:
    """Return what figaroh's own regressor says about a person on a free-flyer: "" or its error."""
    from figaroh.tools.regressor import RegressorBuilder
    from figaroh.tools.robot import Robot

    try:
        robot = Robot(str(folder / "model.urdf"), str(folder), isFext=True)
        assert robot.model.nq == problem["q"].shape[1], "the free-flyer was not added"
        RegressorBuilder(robot).build_basic_regressor(problem["q"], problem["v"], problem["a"])
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def main() -> None:
    """Fit with the default prior weight and with two others."""
    from figaroh.identification.physical_fit import PhysicalPolicy, build_problem, solve_direct_effort_fit

    folder = Path(sys.argv[1])
    problem = np.load(folder / "problem.npz")
    segments = [str(s) for s in problem["segments"]]
    names = [f"{key}_{segment}" for segment in segments for key in KEYS]
    found = {"workflow": default_workflow(folder, problem), "fits": {}}
    for weight in (None, 1.0, 10.0):
        start = time.perf_counter()
        policy = PhysicalPolicy() if weight is None else PhysicalPolicy(prior_weight=weight)
        shared = build_problem(problem["W"], problem["wrench"], names, segments, prior=problem["prior"], policy=policy)
        record = solve_direct_effort_fit(shared)
        phi = None if record.theta is None else [float(x) for x in record.theta]
        label = "default" if weight is None else f"prior weight {weight:g}"
        said = record.exception or record.solver_status
        found["fits"][label] = {"phi": phi, "seconds": time.perf_counter() - start, "status": said}
    (folder / "answer.json").write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
