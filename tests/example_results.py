"""Hand-made results of a session, for tests of the page and of results.json: every part present, and every part
refused.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.diagnosis.consequence import Adequacy
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.reasons import Reason
from biodance.lab.markers.signals import MarkerGaps
from biodance.motion.newton import QuietStanding
from biodance.pipeline.results import Placed, SessionResult
from biodance.pipeline.saved_results import provenance
from biodance.pipeline.still import Still
from biodance.pipeline.trial import Check, MarkerFit, Step, TrialResult, WeighedBy, Weighing, WrenchComparison
from biodance.records import Markers, Plate, Session, Source, Subject, Trial, Wrench
from biodance.report.pages.session import page

SQUARE = np.array([[0.3, 0.2, 0.0], [-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0], [0.3, -0.2, 0.0]])
NAMES = tuple(f"M{i:02d}" for i in range(1, 34))


def comparison(rng: np.random.Generator) -> WrenchComparison:
    """Return 3 s of a measured wrench beside a simulated one that is nearly right."""
    time = np.arange(300) / 100
    phase = 2 * np.pi * time[:, None] * np.array([0.7, 1.1, 0.4, 0.9, 0.5, 1.3])
    measured = np.array([20, 15, 120, 30, 40, 5]) * np.sin(phase) + np.array([0, 0, 640, 10, -20, 0])
    simulated = measured + rng.normal(0, 1, measured.shape) * np.array([2, 2, 6, 3, 4, 1])
    used = (time > 0.4) & (time < 2.5)
    difference = (measured - simulated)[used]
    cc = [np.corrcoef(measured[used, i], simulated[used, i])[0, 1] for i in range(6)]
    return WrenchComparison(
        time,
        measured,
        simulated,
        used,
        np.sqrt(np.mean(difference**2, axis=0)),
        np.array(cc),
        ("90 frames: a foot is beside the plates.",),
    )


def standing(rng: np.random.Generator) -> QuietStanding:
    """Return 2 s of standing, the CoM 30 mm in front of the CoP."""
    cop = 0.1 + np.cumsum(rng.normal(0, 0.0005, (200, 2)), axis=0)
    feet = np.array([[0.15, 0.25], [-0.05, 0.25], [0.15, -0.02], [-0.05, -0.02]])
    names = ("left_toe", "left_heel", "right_toe", "right_heel")
    com = cop + np.array([0.03, 0.002])
    return QuietStanding(
        "static",
        0.5,
        2.5,
        65.2,
        0.1,
        cop,
        com,
        np.array([1.0, 0.0]),
        0.03,
        0.002,
        feet,
        names,
        (SQUARE + np.array([0.05, 0.1, 0]))[None, :, :2],
    )


def still() -> Still:
    """Return one instant with three bones, markers and one plate; one marker was not seen."""
    bones = np.array([[[0, 0, 0.9], [0, 0, 1.5]], [[0, 0.1, 0.9], [0, 0.1, 0.05]], [[0, -0.1, 0.9], [0, -0.1, 0.05]]])
    markers = np.concatenate([bones.reshape(-1, 3) + 0.05, [[np.nan] * 3]])
    com, force, cop = np.array([0, 0, 1.0]), np.array([0, 0, 640.0]), np.array([0.01, 0, 0])
    return Still(
        "static", 1.0, bones, ("middle", "left", "right"), markers, SQUARE[None], com, force, cop, np.array([1.0, 0.0])
    )


def trial(name: str, *, warnings: tuple[str, ...] = ()) -> Trial:
    """Return a trial with markers at the origin and one plate that carries 640 N."""
    time = np.arange(300) / 100
    plate = Plate(
        "plate1",
        2,
        SQUARE,
        Wrench(time, np.tile([0, 0, 640.0, 0, 0, 0], (300, 1))),
        ("sign turned: the raw force pulled down",),
    )
    source = Source(Path(f"/sessions/S01/{name}.c3d"), "ab" * 32, "C3D", 100.0, 1000.0)
    markers = Markers(NAMES, time, np.zeros((300, len(NAMES), 3)))
    return Trial(
        name,
        "fit",
        markers,
        (plate,),
        source,
        "plug_in_gait_39",
        history=("low-pass: 5th order, 10 Hz",),
        warnings=warnings,
    )


def full_session() -> SessionResult:
    """Return a session in which every step was done, one marker was never seen and one check is outside its limit."""
    rng = np.random.default_rng(3)
    rms = np.sort(rng.uniform(0.003, 0.02, len(NAMES)))
    rms[5] = np.nan
    fit = MarkerFit(NAMES, rms, 2.2 * rms, 0.011, 0.044)
    gaps = tuple(
        MarkerGaps(name, *{3: (2.5, 0.075), 5: (100.0, 3.0)}.get(i, (0.0, 0.0))) for i, name in enumerate(NAMES)
    )
    checks = (
        Check("marker distance, RMS", "walk <1>", "11.0 mm", "at most 20 mm", True),
        Check("gaps", "walk <1>", "3.1 %", "at most 2 %", False, "Fill."),
    )
    result = TrialResult(
        trial("walk <1>"),
        (Step("prepare", "done"), Step("track", "done"), Step("compare", "done")),
        gaps,
        fit,
        None,
        comparison(rng),
        standing(rng),
        checks,
    )
    mass = Check("mass on the plates against declared", "walk <1>", "0.3 %", "at most 2 %", True)
    session = Session(
        Subject(65.0, 1.7, "F", 31.0, "S01"), (result.trial,), Path("/sessions/S01"), notes=("Sex guessed.",)
    )
    return SessionResult(
        session, Placed(None, "Scaled on static."), (Step("scale", "done"),), (result,), (mass,), result.standing,
        weighed=Weighing(65.2, 0.1, WeighedBy.STANDING, ("walk <1>",)),
    )  # fmt: skip


def refused_session() -> SessionResult:
    """Return a session in which nothing after reading could be done, with one unreadable file."""
    why = "Trial walk: no marker is known. Name a marker set."
    bare = Trial(
        "walk", "fit", None, (), Source(Path("/sessions/S02/walk.c3d"), "cd" * 32, "C3D"), warnings=("No plates.",)
    )
    result = TrialResult(bare, (Step("prepare", "refused", why),))
    session = Session(
        Subject(float("nan"), float("nan"), "M"),
        (bare,),
        Path("/sessions/S02"),
        {"broken.c3d": "broken.c3d: is empty."},
    )
    return SessionResult(session, Placed(None, "No body."), (Step("body", "refused", "No stature."),), (result,))


LEFT = (Adequacy("Fx", (0.3, 1.0), 12.0, "walk", 1.0, 5.0),)
UNLIKE = {Reason.FORCES_LEFT: ()}
FOUND = Finding("plate_gain", "Fz", (Estimate("gain", 0.06, 0.002, "1"),), (Alias("plate_gain", "Fz", 80.0),), 0.9)
WHOLE = Diagnosis(True, ())
VERDICTS = (
    WHOLE,
    replace(WHOLE, explained=True, findings=(FOUND,)),
    replace(WHOLE, explained=False, findings=(FOUND,), adequacy=LEFT, why=UNLIKE),
    replace(WHOLE, explained=False, adequacy=LEFT, why=UNLIKE),
    replace(WHOLE, explained=False, adequacy=LEFT, resembles=(FOUND,), why=UNLIKE),
    replace(WHOLE, explained=False, adequacy=LEFT, why={Reason.ONLY_STANDING: (), **UNLIKE}),
    replace(WHOLE, explained=False),
)
"""Every verdict, with what may stand beside it."""

TIME = "2026-01-01T00:00:00Z"


def html_of(result: SessionResult, created: str = TIME) -> str:
    """Return the session's page, made at a fixed time."""
    stills = (still(),) if result.standing else ()
    return page(result, provenance(result, created=created), stills=stills)
