"""Exported models, judged by the programs they are for: OpenSim, MuJoCo and pinocchio must find our joint torques in
them.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from random_bodies import random_body, random_motion
from scipy.spatial.transform import Rotation

from biodance.body.export import euler_angles, formats, write_model
from biodance.body.export.csv import STANDARD
from biodance.body.human.human import human
from biodance.body.parts import UPRIGHT
from biodance.errors import BiodanceError, FileRefused, UnknownName
from biodance.lab.program_tables import read_mot, write_mot
from biodance.motion.dynamics import joint_torques, regressor
from biodance.motion.kinematics import poses
from biodance.pipeline.program_folders import opensim_coordinates
from biodance.records import Motion, Sip, Subject

WOMAN = human(Subject(58.3, 1.64, "F", 31.0, name="a woman & <co>"))


def bodies():
    rng = np.random.default_rng(3)
    return [
        pytest.param(WOMAN, id="human"),
        pytest.param(random_body(rng), id="free"),
        pytest.param(random_body(rng, root="fixed"), id="fixed"),
    ]


def moved(body, seed: int, frames: int = 4) -> Motion:
    return random_motion(body, np.random.default_rng(seed), frames=frames)


@pytest.mark.parametrize("body", bodies())
def test_pinocchio_reads_the_urdf_with_equal_regressor_and_torques(body, tmp_path) -> None:
    pin = pytest.importorskip("pinocchio")
    path = write_model(body, tmp_path / "m.urdf", format="urdf", source="table -- and data")
    model = (
        pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
        if body.n_root
        else pin.buildModelFromUrdf(str(path))
    )
    model.gravity.linear = np.array([0, 0, -9.80665])
    data, motion = model.createData(), moved(body, 0)
    ours = joint_torques(body, motion, {})
    W = regressor(body, motion) if body.n_root else None
    place = [model.idx_qs[model.getJointId(joint.name)] for joint in body.joints]
    speed = [model.idx_vs[model.getJointId(joint.name)] for joint in body.joints]
    root = range(6) if body.n_root else range(0)
    for t in range(motion.time.size):
        q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        q[: body.nq - len(place)], v[root], a[root] = (
            motion.q[t, : body.nq - len(place)],
            motion.v[t, root],
            motion.a[t, root],
        )
        q[place], v[speed], a[speed] = (
            motion.q[t, body.nq - len(place) :],
            motion.v[t, body.n_root :],
            motion.a[t, body.n_root :],
        )
        tau = pin.rnea(model, data, q, v, a)
        assert tau[speed] == pytest.approx(ours.torque[t], abs=1e-8)
        if W is not None:
            Y = pin.computeJointTorqueRegressor(model, data, q, v, a)
            carrier = {frame.name: frame.parentJoint for frame in model.frames if frame.type == pin.FrameType.BODY}
            columns = np.concatenate([np.arange(10) + 10 * (carrier[name] - 1) for name in body.segments])
            pin.forwardKinematics(model, data, q)
            to_lab = data.oMi[1].toDualActionMatrix()
            assert to_lab @ Y[:6][:, columns] == pytest.approx(W[t], abs=1e-8)


@pytest.mark.parametrize("body", bodies())
def test_mujoco_compiles_the_model_and_finds_the_same_torques(body, tmp_path) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(write_model(body, tmp_path / "m.xml", format="mjcf", source="x")))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, motion = mujoco.MjData(model), moved(body, 1)
    ours = joint_torques(body, motion, {})
    named = [model.joint(joint.name) for joint in body.joints]
    place, speed = [joint.qposadr[0] for joint in named], [joint.dofadr[0] for joint in named]
    for t in range(motion.time.size):
        q, v, a = (np.array(x[t]) for x in (motion.q, motion.v, motion.a))
        data.qpos[place], data.qvel[speed], data.qacc[speed] = q[-len(place) :], v[body.n_root :], a[body.n_root :]
        if body.n_root:
            turn = Rotation.from_quat(q[3:7])
            data.qpos[:7] = [*q[:3], *q[[6, 3, 4, 5]]]
            data.qvel[:6] = [*turn.apply(v[:3]), *v[3:6]]
            data.qacc[:6] = [*turn.apply(a[:3] + np.cross(v[3:6], v[:3])), *a[3:6]]
        mujoco.mj_inverse(model, data)
        assert data.qfrc_inverse[speed] == pytest.approx(ours.torque[t], abs=1e-7)
        if body.n_root:
            assert data.qfrc_inverse[:3] == pytest.approx(ours.residual[t, :3], abs=1e-7)
        sites = poses(body, motion.q).points(body.markers.segment, body.markers.position)[t]
        assert np.array([data.site(name).xpos for name in body.markers.names]) == pytest.approx(sites, abs=1e-9)


def euler_state(e: np.ndarray, de: np.ndarray, dde: np.ndarray) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """Return lab_R_root, body angular velocity and acceleration of root angles ZXY (tilt, list, rotation) and their
    rates.
    """

    def slope(e: np.ndarray) -> np.ndarray:
        """Columns: body-frame axis of each of the three successive rotations."""
        Rx, Ry = Rotation.from_euler("X", e[1]), Rotation.from_euler("Y", e[2])
        return np.stack([(Rx * Ry).inv().apply([0, 0, 1]), Ry.inv().apply([1, 0, 0]), np.array([0, 1.0, 0])], axis=1)

    h = 1e-6
    turning = (slope(e + h * de) - slope(e - h * de)) / (2 * h)
    return Rotation.from_matrix(UPRIGHT) * Rotation.from_euler("ZXY", e), slope(e) @ de, slope(e) @ dde + turning @ de


def opensim_torques(model, opensim, values: dict[str, tuple[float, float, float]]) -> dict[str, float]:
    """Return the generalised forces by coordinate for (value, speed, acceleration) by coordinate."""
    state = model.initSystem()
    acceleration, place = opensim.Vector(len(values), 0.0), {}
    for name, (value, speed, push) in values.items():
        coordinate = model.getCoordinateSet().get(name)
        coordinate.setValue(state, value, False)
        coordinate.setSpeedValue(state, 1e9)
        place[name] = next(i for i in range(len(values)) if state.getU().get(i) == 1e9)
        coordinate.setSpeedValue(state, speed)
        acceleration.set(place[name], push)
    found = opensim.InverseDynamicsSolver(model).solve(state, acceleration)
    return {name: found.get(i) for name, i in place.items()}


@pytest.mark.parametrize("body", bodies())
def test_opensim_reads_the_model_and_finds_the_same_torques(body, tmp_path) -> None:
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Error")
    model = opensim.Model(str(write_model(body, tmp_path / "m.osim", format="osim", source="x")))
    rng, joints = np.random.default_rng(2), [joint.name for joint in body.joints]
    for _ in range(3):
        motion = random_motion(body, rng, frames=1)
        values = {
            n: (motion.q[0, body.nq - len(joints) + i], motion.v[0, body.n_root + i], motion.a[0, body.n_root + i])
            for i, n in enumerate(joints)
        }
        if body.n_root:
            e, p = rng.normal(0, 0.5, (3, 3)), rng.normal(size=(3, 3))
            turn, w, dw = euler_state(*e)
            q, v, a = np.array(motion.q), np.array(motion.v), np.array(motion.a)
            velocity, lab_acceleration = turn.inv().apply(UPRIGHT @ p[1]), turn.inv().apply(UPRIGHT @ p[2])
            q[0, :3], q[0, 3:7] = UPRIGHT @ p[0], turn.as_quat()
            v[0, :6], a[0, :6] = [*velocity, *w], [*(lab_acceleration - np.cross(w, velocity)), *dw]
            motion = Motion(motion.time, q, v, a)
            names = [f"{body.segments[0]}_{word}" for word in ("tilt", "list", "rotation", "tx", "ty", "tz")]
            values |= dict(zip(names, zip(*np.hstack([e, p]), strict=True), strict=True))
            table = opensim_coordinates(body, motion)
            assert table.values[0] == pytest.approx([values[name][0] for name in table.columns], abs=1e-9)
        ours = joint_torques(body, motion, {})
        found = opensim_torques(model, opensim, values)
        assert [found[name] for name in joints] == pytest.approx(list(ours.torque[0]), abs=1e-6)
        if body.n_root:
            force = UPRIGHT @ [found[name] for name in names[3:]]
            assert force == pytest.approx(ours.residual[0, :3], abs=1e-6)


def test_opensim_finds_the_markers_where_they_are(tmp_path) -> None:
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Error")
    model = opensim.Model(str(write_model(WOMAN, tmp_path / "m.osim", format="osim")))
    state = model.initSystem()
    model.realizePosition(state)
    ours = poses(WOMAN, WOMAN.neutral).points(WOMAN.markers.segment, WOMAN.markers.position)[0] @ UPRIGHT
    for name, place in zip(WOMAN.markers.names, ours, strict=True):
        found = model.getMarkerSet().get(name).getLocationInGround(state)
        assert [found.get(i) for i in range(3)] == pytest.approx(list(place), abs=1e-9)


def test_coordinates_survive_the_mot_file(tmp_path) -> None:
    time = np.arange(30) / 100
    q = np.tile(WOMAN.neutral, (30, 1))
    q[:, 7:] = np.sin(time[:, None] * np.arange(1, 24))
    table = opensim_coordinates(WOMAN, Motion(time, q, np.zeros((30, 29)), np.zeros((30, 29))))
    back = read_mot(write_mot(tmp_path / "m.mot", table))
    assert back.columns == table.columns
    assert back.values == pytest.approx(table.values, abs=1e-9)
    assert back["right_knee_flexion"] == pytest.approx(q[:, 7 + WOMAN.joint_index("right_knee_flexion")], abs=1e-9)


def test_csv_reads_back_exactly_and_its_derived_rows_are_right(tmp_path) -> None:
    path = write_model(WOMAN, tmp_path / "m.csv", format="csv", source='identified, "session 1"')
    table = pd.read_csv(path, dtype=str).query("quantity in @STANDARD")
    assert tuple(table["segment"].unique()) == WOMAN.segments
    assert np.array_equal(table["value"].astype(float), WOMAN.sip.phi)
    assert table["sd"].astype(float).to_numpy() ** 2 == pytest.approx(np.diag(WOMAN.sip.covariance), rel=1e-15)
    rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    com = [float(row[2]) for row in rows if row[:2] == ["left_shank", "com_y"]]
    assert com == [pytest.approx(WOMAN.sip.com[5, 1])]


def test_csv_standard_deviations_of_the_centre_of_mass_are_those_of_samples(tmp_path) -> None:
    path = write_model(WOMAN, tmp_path / "m.csv", format="csv")
    line = next(line for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("trunk_head,com_y"))
    i = 10 * WOMAN.segment_index("trunk_head")
    block = slice(i, i + 10)
    rng = np.random.default_rng(0)
    sample = rng.multivariate_normal(WOMAN.sip.phi[block], WOMAN.sip.covariance[block, block], 20000)
    assert float(line.split(",")[4]) == pytest.approx(np.std(sample[:, 2] / sample[:, 0]), rel=0.05)


def test_biomod_holds_every_segment_joint_and_marker(tmp_path) -> None:
    lines = write_model(WOMAN, tmp_path / "m.bioMod", format="biomod").read_text(encoding="utf-8").splitlines()
    named = [line.split()[1] for line in lines if line.startswith("segment ")]
    assert set(WOMAN.segments) | {joint.name for joint in WOMAN.joints} <= set(named)
    parents = [line.split()[1] for line in lines if line.startswith("  parent ")]
    assert set(parents) <= set(named)
    assert sum(float(line.split()[1]) for line in lines if line.startswith("  mass ")) == pytest.approx(58.3)
    assert sum(line.startswith("marker ") for line in lines) == len(WOMAN.markers.names)


@pytest.mark.parametrize("format", sorted(formats()))
@pytest.mark.parametrize(("parameter", "value"), [(0, -1.0), (4, 99.0), (2, 5.0), (7, np.nan)])
def test_an_inertia_that_cannot_exist_is_refused(format: str, parameter: int, value: float, tmp_path) -> None:
    phi = np.array(WOMAN.sip.phi)
    phi[10 * WOMAN.segment_index("left_thigh") + parameter] = value
    with pytest.raises(BiodanceError, match="left_thigh"):
        write_model(replace(WOMAN, sip=Sip(WOMAN.segments, phi, WOMAN.sip.covariance)), tmp_path / "m", format=format)
    assert not (tmp_path / "m").exists()


def test_nothing_is_overwritten_and_names_are_listed(tmp_path) -> None:
    path = write_model(WOMAN, tmp_path / "m.urdf", format="urdf")
    with pytest.raises(FileRefused, match="exists already"):
        write_model(WOMAN, path, format="urdf")
    with pytest.raises(UnknownName, match="biomod, csv, glb, mjcf, osim, urdf"):
        write_model(WOMAN, tmp_path / "m.obj", format="obj")
    assert len(STANDARD) == 10


def test_angles_of_a_rotation_are_exact_in_the_singular_posture_too() -> None:
    rng = np.random.default_rng(5)
    turns = [*Rotation.random(20, rng=rng).as_matrix(), Rotation.from_euler("y", 90, degrees=True).as_matrix(), UPRIGHT]
    for R in turns:
        for order in ("xyz", "XYZ"):
            angles = euler_angles(order, R)
            assert Rotation.from_euler(order, angles).as_matrix() == pytest.approx(R, abs=1e-12)
