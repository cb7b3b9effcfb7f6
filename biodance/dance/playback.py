"""Play a dance in MuJoCo (extra ``peers``): the root is free, the soles are contact points on a plane with friction,
and the joints alone follow the plan. Told is whether it stays up, where the pressure goes and how far it is off.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from biodance.body.body import Body
from biodance.body.export import mjcf
from biodance.dance.dance import Dance
from biodance.dance.limits.floor import LowParts
from biodance.dance.problem.splines import phase_at
from biodance.dance.problem.stance import support_depth
from biodance.errors import BiodanceError, MissingLibrary
from biodance.motion.dynamics import joint_torques, predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Wrench
from biodance.spatial import quaternion_matrix, wrench_about_origin, wrench_about_point

_STEP = 0.00025
"""s, of the simulation: at 1 and 0.5 ms stiff legs ring on the floor and topple postures that stand at 0.25 ms."""
STIFFNESS = {"hip": 4000.0, "knee": 4000.0, "ankle": 4000.0, "trunk": 3000.0, "shoulder": 400.0, "elbow": 200.0}
"""N·m/rad of the joint springs: several times the m g h (about 600 N·m/rad) that would topple a standing person."""
_DAMPING, ROTOR = 0.05, 0.005
"""s, damper over spring; kg·m² added to every joint in the simulation: where two axes of a shoulder are nearly in line,
nothing else resists them."""
SETTLE = 0.5
"""s in which the first posture is held before the motion begins, so that the floor bears the body."""
RADIUS = 0.004
"""m, of the contact points under the soles."""
_EQUAL = 0.03
"""Weight of equal forces at the corners of the soles, against the zero-moment point in dm."""


@dataclass(frozen=True, eq=False)
class Playback:
    """What became of a plan, at its own instants ``time`` (T,) s up to the fall.

    ``angle_error`` (T, n) rad joints, ``root_error`` (T,) m, ``tilt_error`` (T,) rad of the root; ``wrench`` of the
    floor on the body about the lab origin, ``planned_wrench`` what the plan needs; ``fell`` s, NaN if it did not; ``q``
    (T, nq) where the body was; ``touched`` when (s) each part first came to the floor that is no foot.
    """

    time: Array
    angle_error: Array
    root_error: Array
    tilt_error: Array
    wrench: Wrench
    planned_wrench: Wrench
    fell: float
    q: Array
    touched: dict[str, float]

    @property
    def stays_up(self) -> bool:
        """Whether the body never fell."""
        return bool(np.isnan(self.fell))

    @property
    def zmp_error(self) -> Array:
        """(T,) m between the centres of pressure of the playback and of the plan; NaN where the body is in the air."""
        return np.linalg.norm((self.wrench.cop() - self.planned_wrench.cop())[:, :2], axis=1)


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise MissingLibrary(
            "Playing a dance needs MuJoCo, which is not installed: pip install 'biodance[peers]'."
        ) from error
    return mujoco


def floor_model(body: Body, *, friction: float = 0.5) -> Any:
    """Return the MuJoCo model of ``body`` with contact points at its soles' corners and at the ends of its other parts,
    ``friction`` of the floor.
    """
    mujoco = _mujoco()
    spec = mujoco.MjSpec.from_string(mjcf.text(body, "biodance playback"))
    spec.option.timestep, spec.option.integrator = _STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # s: at 8 ms a foot under the whole body sinks by 0.6 mm, and a person on one leg falls
    contact: dict[str, Any] = {"solref": [0.002, 1.0], "friction": [friction, 0.0, 0.0], "condim": 3}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=1, conaffinity=2, **contact)
    feet = body.feet.values()
    touching = [(foot.segment, corner, RADIUS) for foot in feet for corner in foot.outline + np.array([0, RADIUS, 0])]
    parts = LowParts.of(body)
    for segment, place, radius in (*touching, *zip(parts.segment, parts.place, parts.radius, strict=True)):
        sphere = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [radius, 0, 0], "pos": place, "mass": 0.0}
        spec.body(body.segments[segment]).add_geom(**sphere, contype=2, conaffinity=1, **contact)
    return spec.compile()


def planned_torques(body: Body, motion: Motion, wrench: Wrench, down: NDArray[np.bool_] | None = None) -> Array:
    """Return the joint torques (T, n) N·m of the plan, the ground wrench shared by the feet (right, left) that are
    ``down`` (T, 2); without it, those whose soles are near the floor.
    """
    pose, feet = poses(body, motion.q), _both(body)
    soles = [pose.points([foot.segment] * len(foot.outline), foot.outline) for foot in feet]
    if down is None:
        # A planned sole within 1 cm of the floor is planted.
        down = np.stack([sole[:, :, 2].mean(axis=1) < 0.01 for sole in soles], axis=1)
    parts = borne_by_feet(wrench, soles, down)
    names = [body.segments[foot.segment] for foot in feet]
    return joint_torques(body, motion, dict(zip(names, parts, strict=True))).torque


def borne_by_feet(total: Wrench, soles: list[Array], down: NDArray[np.bool_]) -> list[Wrench]:
    """Return the wrench of each foot, their sum ``total``: pressing forces at the corners of the ``soles`` (T, K, 3)
    that are ``down``, as equal as the zero-moment point allows, so that no foot is asked for pressure outside its own
    sole (as the rule of `motion.dynamics.distribute` may); the horizontal force and the twist go with them.
    """
    point = np.nan_to_num(total.cop())  # no load: about the origin
    corners, foot = np.concatenate(soles, axis=1), np.repeat([0, 1], [sole.shape[1] for sole in soles])
    bears = np.where(down.any(axis=1, keepdims=True), down, True)[:, foot]  # no foot planned down: both
    shares = np.zeros(bears.shape)
    for t, here in enumerate(bears):
        # least squares: the shares add up to 1, their middle is the zero-moment point (in dm), and each is near 0
        away = 10.0 * (corners[t, here, :2] - point[t, :2]).T
        rows = np.vstack([np.ones(here.sum()), away, _EQUAL * np.eye(here.sum())])
        shares[t, here] = nnls(rows, np.eye(len(rows))[0])[0]
    shares /= shares.sum(axis=1, keepdims=True)
    middle = np.einsum("tk,tki->ti", shares, corners)
    whole, out = wrench_about_point(total.value, point), list[Wrench]()
    for side in (0, 1):
        share = shares[:, foot == side]
        own = share.sum(axis=1, keepdims=True)
        place = np.einsum("tk,tki->ti", share, soles[side]) / np.where(own > 0, own, 1.0)
        # what the soles cannot bear (a point outside of them) moves both places alike: forces and moments add up
        out.append(Wrench(total.time, own * wrench_about_origin(whole, place + point - middle)))
    return out


def _both(body: Body) -> tuple[Any, Any]:
    if not body.n_root or set(body.feet) != {"right", "left"}:
        raise BiodanceError(
            f"{body.name}: a playback needs a free root and a right and a left foot; this body has {sorted(body.feet)}."
        )
    return body.feet["right"], body.feet["left"]


def play(body: Body, motion: Motion, *, friction: float = 0.5, down: NDArray[np.bool_] | None = None) -> Playback:
    """Return what becomes of ``motion`` of ``body``, from rest with feet on the plane z = 0, by its joints alone.

    ``down`` (T, 2) True where the right, the left foot is planned to bear; by default where its sole is near the floor.

    Raises
    ------
    MissingLibrary
        MuJoCo is not installed.
    BiodanceError
        The body has no free root or not two feet.
    """
    mujoco = _mujoco()
    wrench = predict_wrench(body, motion)
    torque = planned_torques(body, motion, wrench, down)
    model = floor_model(body, friction=friction)
    data = mujoco.MjData(model)
    driver = _Driver(body, model)
    driver.place(data, motion.q[0], motion.v[0])
    for _ in range(round(SETTLE / _STEP)):
        driver.drive(data, motion.q[0, 7:], np.zeros(len(body.joints)), torque[0])
        mujoco.mj_step(model, data)
    rows, fell, touched = list[tuple[Any, ...]](), np.nan, dict[str, float]()
    for frame in range(motion.time.size):
        if frame:
            _advance(mujoco, driver, data, motion, torque, frame)
        q = np.concatenate([data.qpos[:3], data.qpos[[4, 5, 6, 3]], data.qpos[driver.q_place]])  # Pinocchio's order
        rows.append((*driver.gap(data, motion.q[frame]), _floor_wrench(data), q))
        for part in driver.touching(data):
            touched.setdefault(part, float(motion.time[frame]))
        # Fallen: the root is below 0.6 of its planned height.
        if data.qpos[2] < 0.6 * motion.q[frame, 2]:
            fell = float(motion.time[frame])
            break
    angle, root, tilt, floor, q = (np.array(column) for column in zip(*rows, strict=True))
    time, planned = motion.time[: len(rows)], wrench.value[: len(rows)]
    return Playback(time, angle, root, tilt, Wrench(time, floor), Wrench(time, planned), fell, q, touched)


def _advance(mujoco: Any, driver: "_Driver", data: Any, motion: Motion, torque: Array, frame: int) -> None:
    """Simulate from the frame before to ``frame``; the plan is followed linearly in between."""
    steps = max(1, round((motion.time[frame] - motion.time[frame - 1]) / _STEP))
    joints, share = len(driver.body.joints), np.arange(steps)[:, None] / steps
    planned = (motion.q[:, -joints:], motion.v[:, -joints:], torque)
    ways = [(1 - share) * x[frame - 1] + share * x[frame] for x in planned]
    for q, v, tau in zip(*ways, strict=True):
        driver.drive(data, q, v, tau)
        mujoco.mj_step(driver.model, data)


class _Driver:
    """Where the joints of a body are in MuJoCo's coordinates, and their springs (n,) N·m/rad; sets the dampers."""

    def __init__(self, body: Body, model: Any) -> None:
        self.body, self.model = body, model
        self.q_place = np.array([model.joint(joint.name).qposadr[0] for joint in body.joints])
        self.v_place = np.array([model.joint(joint.name).dofadr[0] for joint in body.joints])
        kinds = [next((kind for kind in STIFFNESS if kind in joint.name), "trunk") for joint in body.joints]
        self.stiffness = np.array([STIFFNESS[kind] for kind in kinds])
        model.dof_damping[self.v_place] = _DAMPING * self.stiffness
        model.dof_armature[self.v_place] = ROTOR

    def place(self, data: Any, q: Array, v: Array) -> None:
        """Put the body into a configuration of Pinocchio's order (quaternion x y z w, velocity in the root's frame)."""
        data.qpos[:3], data.qpos[3:7] = q[:3], q[[6, 3, 4, 5]]
        # MuJoCo: linear velocity in the world, angular velocity in the body.
        data.qvel[:3] = quaternion_matrix(q[None, 3:7])[0] @ v[:3]
        data.qvel[3:6] = v[3:6]
        data.qpos[self.q_place], data.qvel[self.v_place] = q[7:], v[6:]

    def drive(self, data: Any, angle: Array, rate: Array, torque: Array) -> None:
        """Set the joint torques of a plan; the damper itself is in the model, where MuJoCo integrates it implicitly."""
        spring = self.stiffness * (angle - data.qpos[self.q_place])
        # The model's damper brakes with -d v; with d v_plan added it acts on the difference alone.
        data.qfrc_applied[self.v_place] = torque + spring + _DAMPING * self.stiffness * rate

    def touching(self, data: Any) -> set[str]:
        """Return the segments that are no feet and touch the floor."""
        feet = {self.body.segments[foot.segment] for foot in self.body.feet.values()}
        bodies = np.unique(self.model.geom_bodyid[data.contact.geom])
        return {self.model.body(one).name for one in bodies} - feet - {"world"}

    def gap(self, data: Any, q: Array) -> tuple[Array, float, float]:
        """Return the distances from the plan: joint angles (n,) rad, root m, root's tilt rad."""
        # The root's up axis, planned and simulated.
        up = quaternion_matrix(np.stack([q[3:7], data.qpos[[4, 5, 6, 3]]]))[:, :, 1]
        cosine = np.clip(up[0] @ up[1], -1.0, 1.0)
        return data.qpos[self.q_place] - q[7:], float(np.linalg.norm(data.qpos[:3] - q[:3])), float(np.arccos(cosine))


def _floor_wrench(data: Any) -> Array:
    """Return the wrench (6,) of all contacts on the body about the lab origin, N and N·m: what constrains its root."""
    # a free root's generalised force: along the world's axes, then about the root's own (body 1; 0 is the world)
    force, moment = data.qfrc_constraint[:3], data.xmat[1].reshape(3, 3) @ data.qfrc_constraint[3:6]
    return wrench_about_origin(np.concatenate([force, moment]), data.xpos[1])


_RATE = 100.0  # Hz at which plan and playback are compared
UNSURE = 0.2
"""s around the instant at which a foot leaves the ground, or comes back, in which it may still, or already, bear: it
rises by 10 h (t/T)³ at first, so that what sinks by 1 mm bears 0.2 s longer where h = 0.1 m in T = 2 s."""


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """``playback`` of the ``dance`` (its holds shortened), ``inside`` (T,) m how far the centre of pressure of the
    simulated floor is inside the whole base of support of the feet that are planned to be down, or may be still or
    already (`UNSURE`); negative: outside.
    """

    dance: Dance
    playback: Playback
    inside: Array

    @property
    def broken(self) -> tuple[str, ...]:
        """What the plan did not foresee, in phrases: a fall, a hand on the floor, pressure outside the soles."""
        p = self.playback
        told = [] if p.stays_up else [f"falls at {p.fell:.1f} s of {self.dance.duration:.1f} s"]
        told += [f"the {part.replace('_', ' ')} comes to the floor at {at:.1f} s" for part, at in p.touched.items()]
        if (least := float(np.nanmin(self.inside))) < -RADIUS:
            when = p.time[int(np.nanargmin(self.inside))]
            told.append(f"the pressure is {-1000 * least:.0f} mm outside the soles at {when:.1f} s")
        return tuple(told)

    def table(self) -> str:
        """Return what became of the dance in a few lines of Markdown."""
        p, fate = self.playback, "; ".join(self.broken) or "stays up to the end, on its feet alone"
        angle, gap = np.degrees(p.angle_error), 1e3 * p.zmp_error[np.isfinite(p.zmp_error)]
        inside = 1e3 * self.inside[np.isfinite(self.inside)]
        angle_rms, gap_rms = (np.sqrt(np.mean(error**2)) for error in (angle, gap))
        most, least = np.quantile(gap, 0.99), np.quantile(inside, 0.01)
        rows = (
            ("fate", fate),
            ("joint angles, RMS and worst gap to the plan", f"{angle_rms:.2f} and {np.abs(angle).max():.1f} deg"),
            ("tilt of the pelvis, worst gap", f"{np.degrees(p.tilt_error.max()):.1f} deg"),
            ("place of the pelvis, worst gap", f"{1e3 * p.root_error.max():.0f} mm"),
            ("centre of pressure, RMS and 99 % gap", f"{gap_rms:.1f} and {most:.0f} mm"),
            ("centre of pressure inside the soles, 1 % and least", f"{least:.0f} and {inside.min():.0f} mm"),
        )
        return "\n".join(["| what | found |", "|---|---|", *(f"| {what} | {found} |" for what, found in rows)])


def rehearse(dance: Dance, *, hold: float = 0.5, friction: float = 0.5) -> Rehearsal:
    """Return what becomes of a dance whose postures are held for ``hold`` s only, driven by its joints alone.

    Raises
    ------
    MissingLibrary
        MuJoCo is not installed.
    BiodanceError
        It is danced on a stool, which is not simulated.
    """
    if any(stance.seat for stance in dance.stances):
        raise BiodanceError(f"Dance {dance.protocol}: is danced on a stool, which is not simulated. Play another one.")
    short = replace(dance, hold=np.minimum(dance.hold, hold))
    motion = short.motion(_RATE)
    played = play(dance.body, motion, friction=friction, down=bearing(short, motion.time))
    feet, inside = [phase.stance for phase in short.phases], np.full(len(played.time), -np.inf)
    # As planned, a little earlier and a little later: the foot may bear in any of them.
    for late in (0.0, -UNSURE, UNSURE):
        owner = phase_at(short.phases, np.clip(played.time + late, 0.0, short.duration))
        inside = np.maximum(inside, support_depth(feet, owner, played.wrench.cop()[:, :2]))
    return Rehearsal(short, played, inside)


def bearing(dance: Dance, time: Array) -> NDArray[np.bool_]:
    """Return (T, 2) True where the right, the left foot is planned to be down at instants ``time`` s."""
    planted = np.array([[side in phase.stance.planted for side in (0, 1)] for phase in dance.phases])
    return planted[phase_at(dance.phases, time)]
