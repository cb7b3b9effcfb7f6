"""A body that moves otherwise than where tolerances were learned: what no marker shows is noise of a known size, and no
cause is taken from a simulation that cannot be believed.
"""

import numpy as np
import pytest
from diagnosed_sessions import body, gain, known, windows
from inferred_sessions import BARE, SILENT

from biodance.body.body import Body
from biodance.effects import causes
from biodance.inference.session import judge, see
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, Motion
from biodance.uncertainty.bands import BANDS, Noise
from biodance.uncertainty.session_noise import of_unseen_joints

ARMS = {"right_shoulder", "right_elbow", "left_shoulder", "left_elbow"}
ABOUT = np.array([0.1, -0.2, 0.0])
BENT = {"shoulder": 0.38, "elbow": 0.78}
SIZES = {"shoulder": (0.13, 1.62, 5.2, 6.0), "elbow": (0.1, 1.73, 6.2, 7.1)}
"""rad/s² root mean square in the four bands above the mean, as the table says, and rad that they are bent."""


def test_a_body_that_markers_show_everywhere_has_no_more_noise() -> None:
    assert not of_unseen_joints(body(), body().neutral[None], ABOUT).any()


def test_noise_of_unseen_joints_is_what_their_movement_adds_to_the_wrench() -> None:
    """Arms that swing at random about where they hang, or are bent: what the plates measure, drawn and added up."""
    held = body().holding(ARMS, body().neutral)
    expected = of_unseen_joints(held, held.neutral[None], ABOUT)
    rng, square = np.random.default_rng(5), np.zeros((len(BANDS), 6))
    for turn in range(120):
        drawn = _swinging(held, rng, bent=(turn % 3 - 1.0))
        for b in range(1, len(BANDS)):
            square[b] += np.mean(drawn[0][drawn[1] == b] ** 2, axis=0) / 120
    sizes = np.sqrt(np.stack([np.diagonal(one) for one in expected]))
    ratio = np.sqrt(square[2:4]) / sizes[2:4]  # slower is in few coefficients, and the fastest band takes of the others
    assert np.all((ratio > 0.75) & (ratio < 1.4)), ratio.round(2)
    assert not expected[0].any()


def _swinging(held: Body, rng: np.random.Generator, *, bent: float) -> tuple[Array, Array]:
    """Return coefficients (m, 6) of the wrench that unseen joints add in 10 s, and their bands (m,)."""
    count, rate = 1000, 100.0
    time = np.arange(count) / rate
    q, v, a = (np.zeros((count, size)) for size in (held.nq, held.nv, held.nv))
    q += held.neutral
    for k in np.flatnonzero(~held.free):
        kind = held.joints[k].name.split("_")[1]
        shift = held.nq - len(held.joints) + k, held.n_root + k
        q[:, shift[0]] += bent * BENT[kind]
        for low, high, size in zip(BANDS.edges[1:-1], BANDS.edges[2:], SIZES[kind], strict=True):
            for f in rng.uniform(low, high, 6):
                way, turn = size * np.sqrt(2 / 6), rng.uniform(0, 2 * np.pi)
                phase = 2 * np.pi * f * time + turn
                q[:, shift[0]] -= way * np.sin(phase) / (2 * np.pi * f) ** 2
                v[:, shift[1]] -= way * np.cos(phase) / (2 * np.pi * f)
                a[:, shift[1]] += way * np.sin(phase)
    still = np.zeros_like(a)
    resting = predict_wrench(held, Motion(time, np.tile(q.mean(axis=0), (count, 1)), still, still)).value
    added = (predict_wrench(held, Motion(time, q, v, a)).value - resting) @ Noise.unit(ABOUT, BANDS).shift.T
    thinned = added[:: BANDS.stride(rate)]
    there = BANDS.at(rate)
    return there.coefficients(thinned), there.of(len(thinned))


@pytest.mark.parametrize("simulate", [True, False])
def test_without_simulation_the_forces_name_nothing(simulate: bool) -> None:
    """A plate that shows 6 % too much: what the body leaves is told, and no cause."""
    asked = causes(("plate_gain", "time_delay"))
    seen = see(body(), windows(1, trials=2, hidden=gain(0.06)), known(), asked, None)
    one = judge(seen, SILENT, known(), asked, BARE, simulate=simulate).diagnosis
    assert [finding.effect for finding in one.findings] == (["plate_gain"] if simulate else [])
    assert one.adequacy
