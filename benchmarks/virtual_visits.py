"""Virtual subjects through the front door, cached: simulate -> read -> prepare -> scale -> track -> contact, and what
the truth was.

Used by bench_identification.py. A visit is what identification sees, in the frames of the model, with the true
parameters beside it.
"""

import functools
import hashlib
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from kept_files import kept

import biodance
from biodance.body.body import Body
from biodance.identification.statistics import Fit
from biodance.lab.session.read import read_session
from biodance.library import locate
from biodance.motion.kinematics import poses
from biodance.pipeline.body import body_of
from biodance.pipeline.trial import examine_trial, prepare_trial
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Array, Session, Subject
from biodance.virtual_lab.movement.performance import Performance, perform
from biodance.virtual_lab.movement.protocol import Protocol, read_protocol
from biodance.virtual_lab.person.flesh import of_parameters, parameters_of_inertia, place_inertia
from biodance.virtual_lab.person.person import Person, make_person
from biodance.virtual_lab.recording.laboratory import LabVisit
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.truth import MERGED, load_on, merged_sip

CACHE = Path(os.environ.get("BIODANCE_CACHE", Path(tempfile.gettempdir()) / "biodance_visits"))


@dataclass(frozen=True, eq=False)
class TrackedVisit:
    """One session of a virtual person after tracking.

    ``fits`` are the fit trials, ``validations`` the kept ones; ``true`` (120,) the matter of every segment in the
    model's own frames (mean rigid displacement between true and tracked frame over the fit trials), ``true_own`` (120,)
    in the true joint frames; both WITHOUT loads. ``load`` (segment, kg, place (3,) m in the model's frame) or None;
    ``offset`` (12, 6) mean of turn (rad) and shift (m).
    """

    body: Body
    fits: tuple[Fit, ...]
    validations: tuple[Fit, ...]
    true: Array
    true_own: Array
    frames: Array
    load: tuple[str, float, Array] | None
    true_poses: dict[str, tuple[Array, Array]]


TUNED, FRESH = (2016, 100), (2026, 700)
"""Catalogues: the subjects on which identification was tuned, and those on which it is published; (seed of subjects,
first of sessions).
"""


def subjects(count: int = 20, catalogue: tuple[int, int] = FRESH) -> tuple[Subject, ...]:
    """Return the subjects of a catalogue: both sexes, 45 to 110 kg, 1.50 to 1.95 m, body mass index 18 to 34."""
    rng = np.random.default_rng(catalogue[0])
    out = []
    for i in range(count):
        sex = "FM"[i % 2]
        stature = float(rng.uniform(1.50, 1.80) if sex == "F" else rng.uniform(1.62, 1.95))
        mass = float(np.clip(rng.uniform(19.0, 33.0) * stature**2, 45.0, 110.0))
        out.append(Subject(round(mass, 1), round(stature, 3), sex))
    return tuple(out)


def visit(
    subject: Subject, protocol: str, *, seed: int, session: int = 0, load: tuple[str, float] | None = None
) -> TrackedVisit:
    """Return one visit, from the cache if the same code made it before; ``load`` (one of the 12 segments, kg)."""
    key = f"{subject.mass}-{subject.stature}-{subject.sex}-{protocol}-{seed}-{session}-{load}-{_code()}"
    path = CACHE / f"{hashlib.sha256(key.encode()).hexdigest()[:20]}.pickle"
    return kept(path, lambda: _make(subject, protocol, seed, session, load))


@functools.cache
def _code() -> str:
    """Return a digest of what makes and tracks a visit: the rooms of the package, and all tables."""
    house = Path(biodance.__file__).parent
    files = [path for room in ("virtual_lab", "lab", "body", "motion") for path in sorted((house / room).rglob("*.py"))]
    tables = sorted(Path(locate("anthropometry/uncertainty", "sizes", ".csv")).parents[1].rglob("*.csv"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in (*files, *tables))).hexdigest()


def _make(subject: Subject, protocol: str, seed: int, session: int, load: tuple[str, float] | None) -> TrackedVisit:
    bare = make_person(subject, seed, session=session)
    loads = (load_on(bare, *load),) if load else ()
    person = make_person(subject, seed, session=session, loads=loads)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "session"
        simulate_session(subject, protocol, place, seed=seed, visit=LabVisit(session), loads=loads)
        body, results = _tracked(read_session(place))
    fits: dict[str, list[Fit]] = {"fit": [], "validate": []}
    truth, moved = {}, []
    plan = read_protocol(protocol)
    for one in results:
        role, name = one.trial.role, one.trial.name
        if role not in fits or one.motion is None or one.comparison is None:
            continue
        fits[role].append(Fit(name, one.motion, one.trial.wrench, one.comparison.used))
        truth[name] = true_frames(person, _performance(person, plan, name, session), one.motion.time)
        if role == "fit":
            moved.append(_displacement(body, one.motion.q, truth[name]))
    frames = np.mean(np.concatenate(moved), axis=0)
    own = merged_sip(bare, bare.body).phi
    true = np.concatenate(
        [
            parameters_of_inertia(place_inertia(of_parameters(phi), _orthogonal(f[:, :3]), f[:, 3]))
            for phi, f in zip(own.reshape(-1, 10), frames, strict=True)
        ]
    )
    carried = (load[0], load[1], _load_place(person, load[0], frames)) if load else None
    return TrackedVisit(body, tuple(fits["fit"]), tuple(fits["validate"]), true, own, frames, carried, truth)


def _tracked(session: Session) -> tuple[Body, list[TrialResult]]:
    """Return the body of a session and its trials after all steps before identification."""
    read = tuple(prepare_trial(trial) for trial in session.trials)
    body, _ = body_of(session.subject, read, session.settings, [])
    assert body is not None
    return body, [examine_trial(one, body, mass=session.subject.mass) for one in read]


def _performance(person: Person, plan: Protocol, name: str, session: int) -> Performance:
    trial = next(t for t in plan.trials if t.name == name)
    return perform(person, trial, session, centre=np.array([0.3, 0.2]))


def true_frames(person: Person, performance: Performance, time: Array) -> tuple[Array, Array]:
    """Return turn (T, 12, 3, 3) and origin (T, 12, 3) m of the 12 true joint frames at ``time``."""
    pose = poses(person.body, performance.motion(time).q)
    index = [person.body.joint_index(joint) if joint else -1 for joint, _ in MERGED.values()]
    turn = np.stack([pose.root_rotation if j < 0 else pose.joint_rotation[:, j] for j in index], axis=1)
    place = np.stack([pose.root_position if j < 0 else pose.joint_position[:, j] for j in index], axis=1)
    return turn, place


def _displacement(body: Body, q: Array, truth: tuple[Array, Array]) -> Array:
    """Return [R | p] (T, 12, 3, 4) of every true frame in the tracked frame."""
    pose = poses(body, q)
    back = np.swapaxes(pose.rotation, -1, -2)
    return np.concatenate([back @ truth[0], back @ (truth[1] - pose.position)[..., None]], axis=-1)


def _orthogonal(mean: Array) -> Array:
    U, _, Vt = np.linalg.svd(mean)
    return U @ Vt


def _load_place(person: Person, segment: str, frames: Array) -> Array:
    from biodance.virtual_lab.truth import place_in_12

    own = place_in_12(person, person.loads[0])[1]
    f = frames[list(MERGED).index(segment)]
    return _orthogonal(f[:, :3]) @ own + f[:, 3]
