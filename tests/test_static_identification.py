"""Identification from postures alone (the paper's III.D): rows that lie too far apart to tell a movement between them
are postures at rest, from which masses and centres of mass follow through the same posterior; nobody judges plates or
clocks by them.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import SUBJECT
from identified_sessions import body

from biodance.identification.knowledge import SIGMAS
from biodance.lab.session.read import read_session
from biodance.motion.dynamics import compare, predict_wrench
from biodance.motion.track import smooth
from biodance.pipeline.diagnosis import diagnosed_and_corrected
from biodance.pipeline.session import examine
from biodance.records import Array, Markers, Trial, Wrench
from biodance.spatial import wrench_about_point
from biodance.virtual_lab.movement import Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.simulate import simulate_session

HOLD, AROUND = 1.2, 0.3
"""s that each posture is held, and from its middle over which a row is the mean."""


def held() -> Protocol:
    """Return the postures of the protocol diagnosis, each held for `HOLD` s, its static trial and one of squats."""
    plan = read_protocol("diagnosis")
    moves = tuple(
        replace(one, steps=tuple(replace(s, cycles=0, hold=HOLD, move=max(s.move, 1.0)) for s in one.steps[:-1]))
        for one in plan.trials
        if one.name.startswith("move")
    )
    others = tuple(one for one in plan.trials if one.name in ("static", "squat_1"))
    return replace(plan, trials=(*others, *moves))


def rows_of(plan: TrialPlan, trial: Trial) -> Trial:
    """Return a trial as one row for each posture that was held."""
    ends = plan.lead + np.cumsum([step.move + step.hold for step in plan.steps])
    middles = ends - HOLD / 2

    def mean(time: Array, values: Array) -> Array:
        return np.stack([values[np.abs(time - at) < AROUND].mean(axis=0) for at in middles])

    markers = Markers(trial.markers.names, middles, mean(trial.markers.time, trial.markers.xyz))
    plates = (replace(p, wrench=Wrench(middles, mean(p.wrench.time, p.wrench.value))) for p in trial.plates)
    return replace(trial, markers=markers, plates=tuple(plates))


def test_rows_far_apart_are_postures_at_rest() -> None:
    one = body()
    q = np.tile(one.neutral, (4, 1))
    q[:, 7] = [0.0, 0.4, -0.2, 0.3]
    found = smooth(one, np.array([0.0, 0.7, 1.9, 2.6]), q)
    np.testing.assert_array_equal(found.q, q)
    assert not found.v.any()
    assert not found.a.any()


def test_a_person_is_identified_from_postures_alone(tmp_path: Path) -> None:
    plan = held()
    folder = simulate_session(SUBJECT, plan, tmp_path / "S01", seed=9103)
    session = read_session(folder)
    plans = {one.name: one for one in plan.trials if one.name.startswith("move")}
    trials = tuple(rows_of(plans[t.name], t) if t.name in plans else t for t in session.trials)
    result, found = diagnosed_and_corrected(examine(replace(session, trials=trials)))
    one = result.identification
    assert one is not None
    assert one.status == "solved"
    assert set(one.identification.trials) == set(plans)
    assert one.gain is not None
    assert one.gain.moment_interval[0] > 1.2  # on squats, which no fit saw
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    mass = {row["name"]: row["mass_kg"] for row in truth["segments_12"]}
    known = [k for k in one.identification.known if k.quantity == "mass"]
    inside = [abs(k.value - mass[k.segment]) <= SIGMAS * k.sd for k in known]
    assert sum(inside) >= 11
    centre = [k for k in one.identification.known if k.quantity.startswith("com")]
    assert sum(k.sd < 0.8 * k.table_sd for k in centre) >= 8  # standing tells centres of mass
    assert found is not None
    assert not found.findings
    assert not [row.trial for row in found.diagnosis.judged if row.seconds > 0 and row.trial in plans]
    assert any("postures" in note for note in found.diagnosis.notes)


@pytest.mark.parametrize("kept", ["Trial03"])
def test_the_postures_of_a_real_person_foretell_his_squats(kept: str, data: Path, tmp_path: Path) -> None:
    """The labels of both arms are exchanged in Calib02: they are put right here, as `diagnose --accept` would."""
    raw, folder = data / "laas_human" / "raw", tmp_path / "S01"
    folder.mkdir()
    head, rest = (raw / "Calib02.csv").read_text(encoding="utf-8").split("\n", 1)
    for name in ("ELB", "FIN", "SHO", "WRA", "WRB"):
        head = head.replace(f"L{name}", "@").replace(f"R{name}", f"L{name}").replace("@", f"R{name}")
    (folder / "Calib02.csv").write_text(f"{head}\n{rest}", encoding="utf-8")
    for name in ("Calib01", kept):
        (folder / f"{name}.csv").write_bytes((raw / f"{name}.csv").read_bytes())
    roles = f'[trials.Calib02]\nrole = "fit"\n[trials.{kept}]\nrole = "validate"\n'
    (folder / "session.toml").write_text(f'[subject]\nmass_kg = 94.4\nsex = "M"\n{roles}')
    result, _ = diagnosed_and_corrected(examine(read_session(folder)))
    assert result.identification is not None
    (one,) = result.identification.validations
    table, found = one.table_agreement.rms, one.identified_agreement.rms
    (trial,) = (each for each in result.trials if each.name == kept)
    assert trial.motion is not None
    assert result.body is not None
    alone = wrench_about_point(predict_wrench(result.body, trial.motion).value, one.about)
    alone = compare(one.measured, Wrench(one.measured.time, alone), one.use).rms  # without what its plates read
    assert np.all(found[3:5] < 0.6 * alone[3:5])
    assert np.all(found[3:5] < (2 / 3) * table[3:5])  # with it
    assert np.all(found[3:5] < (5.1, 8.3))
    assert np.all(found[:3] < 1.1 * table[:3])
