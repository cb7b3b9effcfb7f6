"""The session of a virtual person who performs a designed dance: what the laboratory would have recorded."""

import json
from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance, Phase
from biodance.dance.metrics import zmp_path
from biodance.errors import BiodanceError
from biodance.motion.regressor import predict_wrench
from biodance.records import Array, Motion, Subject
from biodance.virtual_lab.movement.choreography import septic
from biodance.virtual_lab.movement.dancing import USUAL_PERFORMER, Performer, Shown, copy_dance
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.movement.protocol import Protocol, read_protocol
from biodance.virtual_lab.person.person import make_person
from biodance.virtual_lab.recording.laboratory import (
    FIRST_VISIT,
    LabVisit,
    perform_in,
    record,
    scale_reading,
    set_up,
    write,
)
from biodance.virtual_lab.simulate import TRUTH, session_toml
from biodance.virtual_lab.truth import truth

_RATE = 100.0
LIFT = 0.4
"""Share of a move in which a foot leaves the ground, at its beginning, or comes back, at its end."""
_OTHERS = "squat"
"""Protocol from which the static trial and the squats kept for validation are taken."""


def stretches(dance: Dance) -> tuple[Shown, ...]:
    """Return the dance in stretches between the steps by which a foot changes its place; the steps themselves are not
    recorded.

    Raises
    ------
    BiodanceError
        The dance is on a stool, which virtual persons cannot do.
    """
    if any(stance.seat for stance in dance.stances):
        raise BiodanceError(
            f"Dance {dance.protocol}: is danced on a stool; virtual persons stand. Choose a standing protocol."
        )
    motion, groups = dance.motion(_RATE), [[0]]
    for p in range(1, len(dance.stances)):
        same = np.array_equal(dance.stances[p].ankle, dance.stances[p - 1].ankle)
        groups[-1].append(p) if same else groups.append([p])
    out = []
    for number, group in enumerate(groups, start=1):
        if len(group) > 1:
            mine = [
                phase
                for phase in dance.phases
                if phase.posture in group and (phase.kind == "hold" or phase.posture > group[0])
            ]
            out.append(_shown(dance, motion, mine, f"dance_{number}"))
    return tuple(out)


def _shown(dance: Dance, motion: Motion, phases: list[Phase], name: str) -> Shown:
    rows = (motion.time >= phases[0].start - 1e-9) & (motion.time <= phases[-1].end + 1e-9)
    part = Motion(motion.time[rows], motion.q[rows], motion.v[rows], motion.a[rows])
    raised = np.max([_raised(dance, phase, part.time) for phase in phases], axis=0)
    return Shown(
        name, dance.body, part, phases[0].stance.ankle, raised, zmp_path(predict_wrench(dance.body, part).value)
    )


def _raised(dance: Dance, phase: Phase, time: Array) -> Array:
    """Return how far each foot is raised during ``phase`` (T, 2), zero outside."""
    inside, out = (time >= phase.start - 1e-9) & (time <= phase.end + 1e-9), np.zeros((time.size, 2))
    for foot in {0, 1} - set(phase.stance.planted):
        up = np.ones(time.size)
        if phase.kind == "move":
            way = (time - phase.start) / (phase.end - phase.start)
            before, after = (foot in dance.stances[p].planted for p in (phase.posture - 1, phase.posture))
            up = (septic(way / LIFT) if before else up) * (septic((1 - way) / LIFT) if after else 1.0)
        out[:, foot] = inside * up
    return out


def simulate_dance(
    subject: Subject,
    dance: Dance,
    out: Path,
    *,
    seed: int,
    performer: Performer = USUAL_PERFORMER,
    visit: LabVisit = FIRST_VISIT,
) -> Path:
    """Write the session of a virtual person who dances ``dance``: static, the dance in stretches, two trials of squats
    for validation.

    ``seed`` is the person. The same arguments write the same bytes.

    Raises
    ------
    BiodanceError
        The folder is not empty.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BiodanceError(f"{out}: exists and is not an empty folder; nothing was written. Choose another --out.")
    person = make_person(subject, seed, tolerances=visit.tolerances, session=visit.number)
    instruments, lab = set_up(person, visit), visit.laboratory
    done: list[Performance] = [
        perform_in(instruments, person, trial)
        for trial in read_protocol(_OTHERS).trials
        if trial.role in ("static", "validate")
    ]
    for shown in stretches(dance):
        done.append(
            copy_dance(
                person,
                shown,
                visit.number,
                centre=np.array(lab.centre),
                heading=lab.heading,
                performer=performer,
                tolerances=visit.tolerances,
            )
        )
    out.mkdir(parents=True, exist_ok=True)
    for performance in done:
        write(record(performance, instruments), out)
    plan = Protocol(dance.protocol, "a designed dance", tuple(performance.plan for performance in done))
    (out / "session.toml").write_text(session_toml(person, plan, scale_reading(person, visit.number, visit.tolerances)))
    (out / TRUTH).mkdir()
    (out / TRUTH / "truth.json").write_text(
        json.dumps(truth(person, dance.protocol, instruments, done), indent=1) + "\n"
    )
    return out
