"""Walking and running on belts in the virtual laboratory: by construction nothing carries a runner in flight, and the
forces are those that move the body; then what the readers make of the files.
"""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from inferred_sessions import heard, heard_in
from inject import inject

from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.errors import BiodanceError
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.observations import observe
from biodance.observations._recording import recording
from biodance.pipeline.session import examine
from biodance.records import Subject
from biodance.virtual_lab.causes import fault_of, parse_cause
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.movement.gait import GaitPerformance, perform_gait
from biodance.virtual_lab.person import make_person
from biodance.virtual_lab.simulate import simulate_session

G = 9.80665
TIME = np.arange(1.0, 2.5, 1e-3)


@pytest.fixture(scope="module", params=["treadmill", "run"])
def going(request: pytest.FixtureRequest) -> GaitPerformance:
    """Somebody who walks or runs, facing 0.4 rad from lab x."""
    plan = read_protocol(request.param).trials[1]
    return perform_gait(make_person(Subject(62.0, 1.68, "F"), 1), plan, 0, centre=np.array([0.3, 0.2]), heading=0.4)


def centres(done: GaitPerformance, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass (S,) kg and centre of mass (T, S, 3) m of every true segment."""
    body, pose = done.person.loaded_body, poses(done.person.body, done.motion(time).q)
    phi = body.sip.phi.reshape(-1, 10)
    own = phi[:, 1:4] / phi[:, :1]
    return phi[:, 0], pose.position + np.einsum("tsij,sj->tsi", pose.rotation, own)


def test_the_forces_are_the_ones_that_move_the_segments(going: GaitPerformance) -> None:
    """Sum of m (a + g) over the segments, accelerations from second differences of their places."""
    mass, place = centres(going, TIME)
    acceleration = np.diff(place, 2, axis=0) * 1e6
    force = np.einsum("s,tsi->ti", mass, acceleration + np.array([0, 0, G]))
    found = going.wrench(TIME).value[1:-1]
    np.testing.assert_allclose(found[:, :3], force, atol=0.004 * mass.sum() * G)


def test_angular_momentum_changes_as_the_forces_turn(going: GaitPerformance) -> None:
    """About the centre of mass, orbital part of the segments plus their spin, against the integral of the moment."""
    mass, place = centres(going, TIME)
    pose = poses(going.person.body, going.motion(TIME).q)
    middle = np.einsum("s,tsi->ti", mass, place) / mass.sum()
    velocity = np.gradient(place - middle[:, None], 1e-3, axis=0, edge_order=2)
    orbit = np.einsum("s,tsi->ti", mass, np.cross(place - middle[:, None], velocity))
    turn = np.gradient(pose.rotation, 1e-3, axis=0, edge_order=2) @ np.swapaxes(pose.rotation, 2, 3)
    rate = np.stack([turn[..., 2, 1], turn[..., 0, 2], turn[..., 1, 0]], axis=-1)
    spin = np.zeros_like(orbit)
    for k, phi in enumerate(going.person.loaded_body.sip.phi.reshape(-1, 10)):
        c, [xx, xy, yy, xz, yz, zz] = phi[1:4] / phi[0], phi[4:]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - phi[0] * (c @ c * np.eye(3) - np.outer(c, c))
        spin += np.einsum("tij,jk,tlk,tl->ti", pose.rotation[:, k], about, pose.rotation[:, k], rate[:, k])
    value = going.wrench(TIME).value
    moment = value[:, 3:] - np.cross(middle, value[:, :3])
    done = np.vstack([np.zeros(3), np.cumsum(0.5e-3 * (moment[1:] + moment[:-1]), axis=0)])
    off = orbit + spin - done
    assert np.abs(off - off.mean(axis=0))[5:-5].max() < 0.02


def test_nothing_carries_a_foot_in_the_air(going: GaitPerformance) -> None:
    on = {side: going.gait.since_strike(TIME, side) < going.gait.contact for side in ("right", "left")}
    for side, there in on.items():
        assert np.abs(going.foot_wrench(TIME, side)[~there]).max() == 0
        assert going.foot_wrench(TIME, side)[there, 2].min() > -0.004 * going.person.mass * G
    flies = ~(on["right"] | on["left"])
    assert flies.mean() == pytest.approx(2 * going.gait.flight / going.gait.stride, abs=0.04)
    assert going.gait.flight == 0 or going.gait.flight > 0.08


def test_a_standing_sole_moves_with_the_belt_and_presses_inside(going: GaitPerformance) -> None:
    """Heel or toe, whichever is lower, goes back at the belt's speed; the pressure lies within the sole."""
    back = -going.gait.speed * np.array([np.cos(going.stance.heading), np.sin(going.stance.heading)])
    pose = poses(going.person.body, going.motion(TIME).q)
    for side in ("right", "left"):
        foot = going.person.body.feet[side]
        sole = pose.points([foot.segment] * len(foot.outline), foot.outline)
        lowest = np.take_along_axis(sole, sole[..., 2].argmin(axis=1)[:, None, None], axis=1)[:, 0]
        on = going.gait.since_strike(TIME, side) < going.gait.contact
        assert np.abs(lowest[on, 2]).max() < 0.004
        flat = on & (np.ptp(sole[..., 2], axis=1) < 0.002)
        speed = np.gradient(sole.mean(axis=1), 1e-3, axis=0)[flat, :2]
        np.testing.assert_allclose(np.median(speed, axis=0), back, rtol=0.02)
        value = going.foot_wrench(TIME, side)
        press = np.stack([-value[:, 4], value[:, 3]], axis=1)[on] / value[on, 2:3]
        firm = value[on, 2] > 50
        away = np.column_stack([press, np.zeros(len(press))]) - pose.position[on, foot.segment]
        own = np.einsum("tji,tj->ti", pose.rotation[on, foot.segment], away)[firm][:, [0, 2]]
        edges = np.array(foot.outline)[:, [0, 2]]
        assert (own > edges.min(axis=0) - 0.002).all()
        assert (own < edges.max(axis=0) + 0.002).all()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """Results of a walking and a running session, read from the files."""
    out = {}
    for name in ("treadmill", "run"):
        folder, asked = tmp_path_factory.mktemp("belts") / name, read_protocol(name)
        plan = replace(asked, trials=(asked.trials[0], replace(asked.trials[1], lead=2.0)))
        out[name] = examine(read_session(simulate_session(Subject(62.0, 1.68, "F"), plan, folder, seed=1)))
    return out


@pytest.mark.parametrize("name", ["treadmill", "run"])
def test_a_session_on_belts_is_followed_and_hardly_a_frame_is_lost(recorded: dict, name: str) -> None:
    result = recorded[name]
    for one in result.trials:
        assert one.fit is not None
        assert one.fit.total_rms < 0.010
        assert one.comparison.used.mean() > 0.97
    notes = [" ".join(one.comparison.notes) for one in result.trials[1:]]
    assert all("a belt" in text for text in notes)


def test_the_flight_of_a_runner_is_found(recorded: dict) -> None:
    """Frames without any load count as measured: the plates say truly that nothing carries."""
    runs = recorded["run"].trials[1:]
    assert runs
    for one in runs:
        empty = one.comparison.measured[:, 2] < 20
        assert 0.15 < empty.mean() < 0.4
        away = slice(20, -20)  # from the ends, where the low-pass makes up the acceleration
        assert one.comparison.used[away][empty[away]].mean() > 0.97


def test_what_is_expected_of_walking_feet_is_not_asked_of_running_ones(recorded: dict) -> None:
    feet = ("foot_across", "foot_along", "shear")
    said = {name: [observe(recording(one.trial), feet) for one in recorded[name].trials[1:]] for name in recorded}
    assert all(said["treadmill"])
    assert {one.kind for some in said["run"] for one in some} == {"foot_across running"}
    walking = max(one.sd for some in said["treadmill"] for one in some if one.kind == "foot_across middle")
    assert all(one.sd == pytest.approx(2 * walking, rel=0.01) for some in said["run"] for one in some)


def test_the_heel_strikes_when_the_force_comes_and_equal_strides_tell_no_fault(recorded: dict) -> None:
    evidence = collect_evidence(recorded["treadmill"].session, ("time_delay", "body_mass", "plate_position"))
    onset = [one.value for one in evidence.observations if one.observer == "force_onset"]
    assert len(onset) > 5
    assert np.abs(np.median(onset)) < 0.006
    assert heard_in(evidence, ("time_delay", "body_mass", "plate_position")).diagnosis.findings == ()
    strides = [one for one in evidence.observations if one.stride in one.norms]
    assert len(strides) > 20
    assert all(one.norms[one.stride] == pytest.approx(one.sd) for one in strides)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("time_delay:delay=0.03", {"time_delay"}),
        ("plate_gain:target=plate1:Fz,gain=0.05", {"plate_gain", "body_mass"}),
        ("plate_position:target=plate1:x,shift=0.02", {"plate_position"}),
    ],
)
def test_a_fault_in_the_bytes_of_a_walk_on_belts_is_named(
    recorded: dict, text: str, names: set[str], tmp_path: Path
) -> None:
    """First, or in the set of what is named."""
    source = Path(recorded["treadmill"].session.folder)
    for path in sorted(source.glob("*.c3d")):
        inject(path, tmp_path / path.name, fault_of(parse_cause(text), {path.stem: (0.0, 1.0)}))
    shutil.copy(source / "session.toml", tmp_path)
    found = heard(read_session(tmp_path)).diagnosis.findings
    assert names & {one.effect for finding in found for one in (finding, *finding.set)}


@pytest.mark.parametrize("text", ['gait = "hop"', 'gait = "run"\nspeed = 9.0', 'gait = "run"\nseconds = 1.0'])
def test_a_gait_that_is_none_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f'belts = 1\n[[trials]]\nname = "a"\n{text}\n')
    with pytest.raises(BiodanceError, match=r"legal|hop"):
        read_protocol(path)
    path.write_text('[[trials]]\nname = "a"\ngait = "run"\n')
    with pytest.raises(BiodanceError, match="belts"):
        read_protocol(path)
