"""People of three laboratories with a known truth: a session of each, what was found in it, and tables over many.

``own`` is the virtual laboratory of this package, ``foreign`` an independent one (BIODANCE_FOREIGN_LAB), ``third`` the
one in benchmarks/third_lab. A person is a seed. The truth of every laboratory is counted in the model's segment frames
of the static trial, so that no misplaced joint centre counts as an error of a CoM; intervals are about the true joint
centres, and so is the truth that they have to hold.
"""

import json
import os
import random
import subprocess
import sys
from collections.abc import Callable, Iterable
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.third_lab import make_session
from biodance.body.body import Body
from biodance.body.human.skeleton import SEGMENTS
from biodance.identification.knowledge import SIGMAS, segment_quantities
from biodance.identification.posterior import BodyPosterior
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine, identification_of
from biodance.records import Array, Motion, Sip, Subject
from biodance.virtual_lab.simulate import simulate_session, sip_in_frames

LABS = ("own", "foreign", "third")
ROOM = ("--noise", "0.6", "--camera", "0.3")
"""Plate and camera noise of the foreign laboratory, as real rooms have it."""
_LIMBS = {"thigh": "thigh", "shank": "shank", "foot": "foot", "upper_arm": "uarm", "forearm_hand": "farm"}
PARTS = {"pelvis": ("pelvis",), "trunk_head": ("trunk", "thorax", "head")} | {
    f"{side}_{ours}": (f"{side[0]}_{theirs}",) for side in ("right", "left") for ours, theirs in _LIMBS.items()
}
"""Segments of the foreign laboratory that make ours."""
DRAWS = 20_000
"""People drawn for the chance of being better than the table."""
Row = dict[str, Any]


def first_seed() -> int:
    """Return the first seed of a run: days since 2000 times 100, of the date on which it is run, so that nobody chooses
    the people on whom a figure is measured.
    """
    return 100 * (date.today() - date(2000, 1, 1)).days


def kept(path: Path, make: Callable[[], Row]) -> Row:
    """Return a row as JSON keeps it, from ``path`` if it is there, else made now; so that a stopped run goes on."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        text = json.dumps(make(), default=lambda value: np.asarray(value).tolist())
        path.with_suffix(".part").write_text(text, encoding="utf-8")
        path.with_suffix(".part").rename(path)
    return dict(json.loads(path.read_text(encoding="utf-8")))


def subject_of(seed: int) -> Subject:
    """Return the person of a seed: both sexes, 1.52 to 1.95 m, body mass index 19.5 to 28.5."""
    draw, sex = random.Random(seed), "FM"[seed % 2]
    stature = round(draw.uniform(*((1.52, 1.75) if sex == "F" else (1.64, 1.95))), 2)
    return Subject(round(draw.uniform(19.5, 28.5) * stature**2, 1), stature, sex, 33.0)


def run_foreign(seed: int, place: Path, *words: object, script: Path | None = None, who: Subject | None = None) -> None:
    """Let the foreign laboratory write a session of a person in a real room, its truth beside ``place``."""
    who = who or subject_of(seed)
    program = [script] if script else [Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py"]
    said = ["--seed", seed, "--sex", who.sex, "--height", who.stature, "--mass", who.mass, *ROOM, "--out", place]
    command = [sys.executable, *map(str, (*program, *words, *said))]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def session_of(lab: str, seed: int, folder: Path, protocol: str = "dance") -> Path:
    """Return the session of a person without fault, made if it is not in the folder."""
    place = folder / f"{lab}_{seed}"
    if not place.is_dir():
        place.parent.mkdir(parents=True, exist_ok=True)
        if lab == "own":
            simulate_session(subject_of(seed), protocol, place, seed=seed)
        elif lab == "foreign":
            run_foreign(seed, place)
        else:
            make_session(place, seed, "none")
    return place


def truth_of(lab: str, place: Path) -> Row:
    """Return what a laboratory says of the truth of a session."""
    path = place / "truth" / "truth.json" if lab == "own" else place.with_name(f"{place.name}.truth.json")
    return dict(json.loads(path.read_text(encoding="utf-8")))


def true_parameters(lab: str, result: SessionResult, true: Row) -> tuple[Array, Array, Array]:
    """Return true masses (N,) kg, CoM (N, 3) m in the model's frames of the static trial, and CoM (N, 3) m from the
    true joint centres (of the pelvis from the model's), in the axes of the model.
    """
    body, static = result.body, next(one.motion for one in result.trials if one.trial.role == "static")
    assert body is not None
    assert static is not None
    return _of_own(body, static, true) if lab == "own" else _of_others(lab, result, body, static, true)


def _of_own(body: Body, static: Motion, true: Row) -> tuple[Array, Array, Array]:
    frame = int(np.argmin(np.abs(static.time - true["static_pose"]["time_s"])))
    pose = poses(body, static.q[frame : frame + 1])
    turn, origin = pose.rotation[0][: len(SEGMENTS)], pose.position[0][: len(SEGMENTS)]
    centres = [origin[0], *(segment["position_m"] for segment in true["static_pose"]["segments_12"][1:])]
    found, own = sip_in_frames(true, turn, origin), sip_in_frames(true, turn, np.array(centres))
    return found.mass, found.com, own.com


def _of_others(lab: str, result: SessionResult, body: Body, static: Motion, true: Row) -> tuple[Array, Array, Array]:
    pose = poses(body, static.q[::10])
    turn, shift = world_to_read(result, true["static"]["markers_m"]) if lab == "third" else (np.eye(3), np.zeros(3))
    mass, com, own = np.zeros(len(body.segments)), *np.zeros((2, len(body.segments), 3))
    for i, name in enumerate(body.segments):
        if lab == "third":
            mass[i], centre = true["lumps_as_recorded"][name]["mass_kg"], true["static"]["com_m"][name]
            joint = None if i == 0 else true["static"]["joint_m"][name]
        else:
            parts = [true["segments"][part] for part in PARTS[name]]
            weight = np.array([part["mass_kg"] for part in parts])
            mass[i], centre = weight.sum(), weight @ [part["com_static_lab_m"] for part in parts] / weight.sum()
            joint = None if i == 0 else parts[0]["origin_static_lab_m"]
        at = pose.position[:, i]
        from_joint = at if joint is None else np.broadcast_to(turn @ joint + shift, at.shape)
        com[i], own[i] = (
            np.einsum("tji,tj->ti", pose.rotation[:, i], turn @ centre + shift - origin).mean(axis=0)
            for origin in (at, from_joint)
        )
    return mass, com, own


def world_to_read(result: SessionResult, markers: dict[str, list[float]]) -> tuple[Array, Array]:
    """Return rotation (3, 3) and shift (3,) m that carry the third laboratory's world over what was read: its true mean
    places of the ``markers`` in the static trial laid over those in the file.
    """
    static = next(one.trial for one in result.trials if one.trial.role == "static")
    names = [name for name in static.markers.names if name in markers]
    read = np.nanmean([static.markers[name] for name in names], axis=1)
    true = np.array([markers[name] for name in names])
    turn = Rotation.align_vectors(read - read.mean(axis=0), true - true.mean(axis=0))[0].as_matrix()
    return turn, read.mean(axis=0) - turn @ true.mean(axis=0)


def deviations(sip: Sip) -> Array:
    """Return the standard deviations (N, 4) of mass, kg, and CoM, m."""
    out = []
    for i in range(len(sip.segments)):
        cut = slice(10 * i, 10 * i + 10)
        slope = segment_quantities(sip.phi[cut])[1][:4]
        out.append(np.sqrt(np.diag(slope @ sip.covariance[cut, cut] @ slope.T)))
    return np.array(out)


def identified(lab: str, place: Path) -> Row:
    """Return what table and identification say of the person of a session, and the truth: masses kg, CoM m; ``gain``
    force and moment of the kept squats, table over identified.
    """
    result = examine(read_session(place))
    one, body = identification_of(result), result.body
    assert body is not None
    mass, com, own_com = true_parameters(lab, result, truth_of(lab, place))
    sip, gain = one.identification.sip, one.gain
    return {
        "lab": lab,
        "segments": body.segments,
        "true": {"mass": mass, "com": com, "own_com": own_com},
        "table": {"mass": body.sip.mass, "com": body.sip.com},
        "identified": {"mass": sip.mass, "com": sip.com},
        "sd": deviations(sip),
        "gain": (gain.force, gain.moment) if gain else None,
        "load": one.search.status,
        "chance": expected_better(one.identification.posterior),
    }


def rows(lab: str, seeds: Iterable[int], folder: Path, protocol: str = "dance") -> list[Row]:
    """Return the rows of people, from ``folder`` where they are there; prints each."""
    out = []
    for seed in seeds:
        path = folder / "rows" / f"{lab}_{protocol}_{seed}.json"
        place = folder / "sessions" / protocol
        out.append(kept(path, lambda seed=seed, place=place: identified(lab, session_of(lab, seed, place, protocol))))
        before, after = (errors(out[-1], which, "mass").mean() for which in ("table", "identified"))
        print(f"{lab} {seed}: mass {before:.2f} -> {after:.2f} kg", flush=True)
    return out


def errors(row: Row, which: str, what: str) -> Array:
    """Return absolute errors (N,) of the mass, kg, or the CoM (distance), m, of "table" or "identified"."""
    off = np.subtract(row[which][what], row["true"][what])
    return np.asarray(np.abs(off) if what == "mass" else np.linalg.norm(off, axis=1))


def standard_errors(row: Row) -> Array:
    """Return errors (N, 4) of mass and of the three coordinates of the CoM over the stated standard deviation."""
    pairs = (("mass", "mass"), ("com", "own_com"))
    off = [np.subtract(row["identified"][what], row["true"][own]) for what, own in pairs]
    return np.column_stack(off) / np.array(row["sd"])


def covered(row: Row) -> tuple[float, float]:
    """Return the shares of masses and of coordinates of CoM that their 95 % interval holds."""
    held = np.abs(standard_errors(row)) <= SIGMAS
    return float(held[:, 0].mean()), float(held[:, 1:].mean())


def expected_better(posterior: BodyPosterior) -> Array:
    """Return the probabilities (3,) that the ``posterior`` is nearer to the truth than its prior in mass, in CoM and in
    both: root mean squares over all segments, linearised about the prior.

    Of a table that happens to fit a person no measurement is better. Under a right model the error that is left, r, and
    the step from the table, d, are independent: r has the posterior's covariance, d what the prior's has beyond it, and
    the table was off by r - d.
    """
    segments = posterior.prior.phi.reshape(-1, 10)
    slope = np.zeros((len(segments), 4, 10 * len(segments)))
    for i, phi in enumerate(segments):
        slope[i, :, 10 * i : 10 * i + 10] = segment_quantities(phi)[1][:4]
    left, step = (
        _drawn(slope.reshape(-1, slope.shape[2]), covariance, seed)
        for seed, covariance in enumerate((posterior.covariance, posterior.prior.covariance - posterior.covariance))
    )
    nearer = [_sizes(left, k) < _sizes(left - step, k) for k in (slice(0, 1), slice(1, 4))]
    return np.array([nearer[0].mean(), nearer[1].mean(), (nearer[0] & nearer[1]).mean()])


def _drawn(slope: Array, covariance: Array, seed: int) -> Array:
    """Return draws (n, N, 4) of mass kg and CoM m of N segments."""
    value, vector = np.linalg.eigh(slope @ covariance @ slope.T)
    normal = np.random.default_rng(seed).normal(size=(DRAWS, len(value)))
    return np.asarray((normal * np.sqrt(np.maximum(value, 0.0)) @ vector.T).reshape(DRAWS, -1, 4))


def _sizes(off: Array, which: slice) -> Array:
    return np.asarray(np.sum(off[:, :, which] ** 2, axis=(1, 2)))


def better(row: Row) -> Array:
    """Return whether a row is nearer to the truth than its table in mass, in CoM and in both (3,)."""
    nearer = [
        bool(np.sum(errors(row, "identified", what) ** 2) < np.sum(errors(row, "table", what) ** 2))
        for what in ("mass", "com")
    ]
    return np.array([*nearer, all(nearer)])


def better_than_table(some: list[Row]) -> str:
    """Return how many rows are better than the table in mass, CoM and both, and of how many that is expected."""
    counts = np.sum([better(row) for row in some], axis=0)
    mass, com, both = 100 * np.mean([row["chance"] for row in some], axis=0)
    told = f"{counts[0]}, {counts[1]}, {counts[2]} of {len(some)}"
    return f"{told} (expected {mass:.0f}, {com:.0f}, {both:.0f} %)"
