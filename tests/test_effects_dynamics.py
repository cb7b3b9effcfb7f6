"""Effects with dynamics of their own, against integrated equations of motion and closed forms."""

import numpy as np
import pytest
from effect_cases import CASES
from scipy.integrate import solve_ivp

from biodance.body.parts import GRAVITY
from biodance.effects import effect
from biodance.effects._base.oscillator import point_motion, relative_motion
from biodance.effects.filter_mismatch import REFERENCE
from biodance.effects.plate_hysteresis import memory

CASE = CASES[1]


def test_riding_mass_follows_its_equation_of_motion() -> None:
    rate, w, damping = 100.0, 2 * np.pi * 5.0, 0.3
    time = np.arange(300) / rate
    acceleration = 4 * np.sin(2 * np.pi * 1.3 * time + 0.4) + 2 * np.cos(2 * np.pi * 3.7 * time)
    x, relative = relative_motion(acceleration[:, None], rate, frequency=5.0, damping=damping)

    def slope(t: float, state: np.ndarray) -> list[float]:
        return [state[1], -2 * damping * w * state[1] - w * w * state[0] - np.interp(t, time, acceleration)]

    truth = solve_ivp(
        slope, (0, time[-1]), [-acceleration[0] / w**2, 0.0], t_eval=time, rtol=1e-9, atol=1e-12, max_step=0.5 / rate
    )
    np.testing.assert_allclose(x[:, 0], truth.y[0], atol=1e-6)
    again = [slope(t, state)[1] for t, state in zip(time, truth.y.T, strict=True)]
    np.testing.assert_allclose(relative[:, 0], again, atol=1e-3)


def test_wobbling_mass_is_the_wrench_of_a_moved_point_mass() -> None:
    """Ground wrench of a rigid body plus a point mass on a spring, from Newton's law of the point mass alone."""
    found = effect("wobbling_mass").at("s2", CASE)
    index = CASE.body.segment_index("s2")
    table = CASE.phi[10 * index : 10 * index + 10]
    place, a = point_motion(CASE, index, table[1:4] / table[0])
    step = 1 / CASE.motion.rate
    np.testing.assert_allclose(
        a[5:-5], np.gradient(np.gradient(place, step, axis=0), step, axis=0)[5:-5], atol=0.05 * np.abs(a).max()
    )
    x, relative = relative_motion(a, CASE.motion.rate, frequency=10.0, damping=0.3)
    mass = 1e-3
    moved, still = place + x, place
    force = mass * (a + relative - GRAVITY)
    change = np.concatenate([force, np.cross(moved, force)], axis=1)
    change -= mass * np.concatenate([a - GRAVITY, np.cross(still, a - GRAVITY)], axis=1)
    second_order = mass * np.abs(np.cross(x, relative)).max()
    np.testing.assert_allclose(found.columns(CASE)[:, :, 0] * mass, change, atol=1.001 * second_order + 1e-12)


def test_slow_movement_hides_a_wobbling_mass() -> None:
    time = np.arange(1000) / 100
    slow, fast = (np.sin(2 * np.pi * f * time)[:, None] for f in (0.3, 3.0))
    ratio = [np.abs(relative_motion(a, 100.0, frequency=5.0, damping=0.3)[1][200:]).max() for a in (slow, fast)]
    assert ratio[0] < 0.01 < 0.3 < ratio[1]


def test_sloshing_goes_on_after_the_person_stops() -> None:
    rate = 100.0
    push = np.zeros((500, 1))
    push[50:80] = 5.0
    relative = relative_motion(push, rate, frequency=1.5, damping=0.08)[1]
    ring = relative[100:, 0]
    crossings = np.flatnonzero(np.diff(np.sign(ring)))
    period = 2 * np.diff(crossings).mean() / rate
    assert period == pytest.approx(1 / 1.5, rel=0.02)
    assert np.abs(ring[-100:]).max() > 0.02 * np.abs(ring).max()


def test_a_rope_pulls_to_its_hook_and_more_as_it_gets_longer() -> None:
    """All forces of the rope, as long as its tension says, end at one hook; the plates miss them where it is tied."""
    found = effect("body_weight_support").at(CASE.body.segments[0], CASE)
    size = np.array([120.0, 300.0, 0.05, 0.2, -0.1, 0.5])
    change = found.transform(CASE, size).residual - CASE.residual
    index = CASE.body.segment_index(CASE.body.segments[0])
    com = CASE.phi[10 * index + 1 : 10 * index + 4] / CASE.phi[10 * index] + [0.0, 0.05, 0.0]
    tied = CASE.poses.points([index], com[None])[:, 0]
    pull = -change[:, :3]
    tension = np.linalg.norm(pull, axis=1)
    length = 2.5 + (tension - 120.0) / 300.0
    hooks = tied + pull / tension[:, None] * length[:, None]
    np.testing.assert_allclose(hooks, np.tile(hooks.mean(axis=0), (len(hooks), 1)), atol=1e-9)
    np.testing.assert_allclose(hooks[0, :2] - CASE.trial.plates[0].centre[:2], [0.2, -0.1], atol=1e-9)
    np.testing.assert_allclose(change[:, 3:], np.cross(tied, change[:, :3]), atol=1e-8)


def test_hysteresis_loop_has_its_width_and_closes() -> None:
    time = np.arange(1200) / 400
    load = 800 + 300 * np.sin(2 * np.pi * time)
    state = memory(load, 20.0)
    last = slice(800, 1200)
    up, down = np.gradient(load[last]) > 0, np.gradient(load[last]) < 0
    middle = np.abs(load[last] - 800) < 30
    assert state[last][up & middle].mean() == pytest.approx(1.0, abs=1e-3)
    assert state[last][down & middle].mean() == pytest.approx(-1.0, abs=1e-3)
    np.testing.assert_allclose(state[400:800], state[800:1200], atol=1e-3)
    assert np.abs(memory(np.full(50, 700.0), 20.0)).max() == 0


def test_lower_filter_takes_the_fourth_power_and_reports_its_cut_off() -> None:
    found = effect("filter_mismatch").at("", CASE)
    truth = 6.0
    theta = np.array([(truth**-4 - REFERENCE**-4) / (4 / REFERENCE**5)])
    name, value, sd, unit = found.reported(CASE, theta, 0.1 * theta)[0]
    assert (name, unit) == ("cutoff", "Hz")
    assert value == pytest.approx(truth)
    assert sd == pytest.approx(0.25 * truth * 0.1 * (1 - (truth / REFERENCE) ** 4), rel=1e-6)
    lost = found.transform(CASE, theta).residual - CASE.residual
    np.testing.assert_allclose(lost.sum(axis=0), 0, atol=1e-6 * np.abs(lost).sum())
    assert np.abs(lost[:, 2]).max() > 1.0
