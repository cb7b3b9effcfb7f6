"""The session of a virtual person who performs a designed dance: what the laboratory would have recorded."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.splines import Phase
from biodance.motion.dynamics import predict_wrench
from biodance.records import SIDES, Array, Motion, Subject
from biodance.spatial import zero_moment_point
from biodance.virtual_lab.faults.causes import Hidden, hide
from biodance.virtual_lab.movement.dancing import ARM, USUAL_PERFORMER, Performer, Shown, copy_dance
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.movement.posing import septic
from biodance.virtual_lab.movement.protocol import STAND, Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.recording.visit import FIRST_VISIT, Instruments, LabVisit, perform_in
from biodance.virtual_lab.simulate import write_visit

_RATE = 100.0
LIFT = 0.4
"""Share of a move in which a foot leaves the ground, at its beginning, or comes back, at its end."""
_OTHERS = "squat"
"""Protocol from which the static trial and the squats kept for validation are taken, of who stands."""
_STILL = Performer(tracking=0.0, pace=1.0)
_SITS = 4.0
"""s of sitting still."""
_BENT = {
    f"{side}_{joint}": math.radians(by) for side in SIDES for joint, by in (("hip_flexion", 90), ("knee_flexion", 85))
}
"""rad by which who sits is bent while the markers are glued, and in the static trial."""


def stretches(dance: Dance) -> tuple[Shown, ...]:
    """Return the dance in stretches between the steps by which a foot changes its place; the steps themselves are not
    recorded.
    """
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
    feet = phases[0].stance
    return Shown(name, dance.body, part, feet.ankle, raised, point, feet.seat)


def _on_the_stool(dance: Dance, danced: tuple[Shown, ...]) -> tuple[Shown, ...]:
    """Return what is recorded on a stool beside the dance: sitting still as the static trial, and the cards' second
    round to validate on.
    """
    x = np.zeros((round(_SITS * _RATE) + 1, dance.chain.size))
    x[:, 2] = danced[0].seat
    arms = {
        f"{side}_{name}": a
        for side in SIDES
        for name, a in zip(ARM, np.radians(STAND.values[f"{side}_arm"]), strict=True)
    }
    for name, angle in (_BENT | arms).items():
        x[:, ROOT + dance.body.joint_index(name)] = angle
    still = dance.chain.motion(np.arange(len(x)) / _RATE, x, *np.zeros((2, *x.shape)))
    nothing = np.zeros((len(x), 2))
    static = Shown("static", dance.body, still, danced[0].ankle, nothing, nothing, danced[0].seat, "static")
    return (static, *(replace(one, name=f"again_{one.name}", role="validate") for one in danced))


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
    for validation; on a stool, which stands on the plate, sitting still and a second round instead.

    ``seed`` is the person; ``hidden`` causes as in `virtual_lab.faults.causes`. The same arguments write the same
    bytes.

    Raises
    ------
    BiodanceError
        The folder is not empty, or the subject is outside the range of the virtual body.
    """
    danced = stretches(dance)
    seated = all(one.seat for one in danced)
    others = [trial for trial in read_protocol(_OTHERS).trials if trial.role in ("static", "validate") and not seated]
    shown = {one.name: one for one in (*danced, *(_on_the_stool(dance, danced) if seated else ()))}
    trials = [one.plan(round(float(np.ptp(one.motion.time)) * performer.pace, 1)) for one in shown.values()]
    plan = Protocol(dance.protocol, "a designed dance", (*others, *trials))
    visit, loads = hide(hidden, subject, plan, seed=seed, visit=visit)

    def performed(instruments: Instruments, person: Person, trial: TrialPlan) -> Performance:
        if trial.name not in shown:
            return perform_in(instruments, person, trial)
        lab = instruments.visit.laboratory
        done = copy_dance(
            person.with_markers_moved(instruments.visit.marker_shifts),
            one := shown[trial.name],
            instruments.visit.number,
            centre=np.array(lab.centre),
            heading=lab.heading,
            performer=_STILL if one.role == "static" else performer,
            tolerances=instruments.visit.tolerances,
        )
        return replace(done, forces=instruments.visit.forces)

    return write_visit(subject, plan, out, performed, seed=seed, loads=loads, visit=visit, bent=_BENT if seated else {})
