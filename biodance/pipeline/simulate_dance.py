"""The session of a virtual person who performs a designed dance: what the laboratory would have recorded."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.splines import Phase
from biodance.errors import BiodanceError
from biodance.motion.regressor import predict_wrench
from biodance.records import Array, Motion, Subject
from biodance.spatial import zero_moment_point
from biodance.virtual_lab.faults.causes import Hidden, hide
from biodance.virtual_lab.movement.dancing import USUAL_PERFORMER, Performer, Shown, copy_dance
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.movement.posing import septic
from biodance.virtual_lab.movement.protocol import Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.recording.visit import FIRST_VISIT, Instruments, LabVisit, perform_in
from biodance.virtual_lab.simulate import write_visit

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
    part = motion.at(rows)
    raised = np.max([_raised(dance, phase, part.time) for phase in phases], axis=0)
    point = zero_moment_point(predict_wrench(dance.body, part).value)[:, :2]
    return Shown(name, dance.body, part, phases[0].stance.ankle, raised, point)


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
    hidden: tuple[Hidden, ...] = (),
    visit: LabVisit = FIRST_VISIT,
) -> Path:
    """Write the session of a virtual person who dances ``dance``: static, the dance in stretches, two trials of squats
    for validation.

    ``seed`` is the person; ``hidden`` causes as in `virtual_lab.faults.causes`. The same arguments write the same
    bytes.

    Raises
    ------
    BiodanceError
        The folder is not empty, the dance is on a stool, or the subject is outside the range of the virtual body.
    """
    shown = {one.name: one for one in stretches(dance)}
    others = [trial for trial in read_protocol(_OTHERS).trials if trial.role in ("static", "validate")]
    danced = [one.plan(round(float(np.ptp(one.motion.time)) * performer.pace, 1)) for one in shown.values()]
    plan = Protocol(dance.protocol, "a designed dance", (*others, *danced))
    visit, loads = hide(hidden, subject, plan, seed=seed, visit=visit)

    def performed(instruments: Instruments, person: Person, trial: TrialPlan) -> Performance:
        if trial.name not in shown:
            return perform_in(instruments, person, trial)
        lab = instruments.visit.laboratory
        done = copy_dance(
            person.with_markers_moved(instruments.visit.marker_shifts),
            shown[trial.name],
            instruments.visit.number,
            centre=np.array(lab.centre),
            heading=lab.heading,
            performer=performer,
            tolerances=instruments.visit.tolerances,
        )
        return replace(done, forces=instruments.visit.forces)

    return write_visit(subject, plan, out, performed, seed=seed, loads=loads, visit=visit)
