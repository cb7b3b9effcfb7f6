"""Channels of EMG by the labels of laboratories, and envelopes of signals made by hand."""

import numpy as np
import pytest

from biodance.cycles import emg_curves
from biodance.cycles.cut import Cycle
from biodance.lab.c3d.subject import FileOutputs, emg_envelopes, muscle_of

RATE = 1000.0
TIME = np.arange(0, 4, 1 / RATE)


@pytest.mark.parametrize(
    ("label", "muscle", "side"),
    [
        ("Voltage.L Tib Ant", "tibialis_anterior", "left"),
        ("Voltage.RTA", "tibialis_anterior", "right"),
        ("R_tibialis_anterior", "tibialis_anterior", "right"),
        ("Voltage.LGAS", "gastrocnemius", "left"),
        ("L VMed", "vastus_medialis", "left"),
        ("EMG Soleus right", "soleus", "right"),
        ("Voltage.RERS", "erector_spinae", "right"),
    ],
)
def test_a_muscle_is_known_by_what_laboratories_call_it(label: str, muscle: str, side: str) -> None:
    assert muscle_of(label) == (muscle, side)


@pytest.mark.parametrize(
    "label", ["Fx1", "Force.Fz2", "L Spare", "Voltage.5", "LGM", "Raw.Pin 56", "FootswitchA", "", "R"]
)
def test_another_channel_is_no_muscle(label: str) -> None:
    assert muscle_of(label) is None


def bursts(size: float) -> np.ndarray:
    """Noise of 50 to 300 Hz, loud from 1 to 2 s."""
    noise = np.random.default_rng(3).standard_normal(TIME.size)
    return size * noise * np.where((TIME > 1) & (TIME < 2), 1.0, 0.02)


def test_an_envelope_follows_the_bursts_and_not_the_offset_in_millivolts() -> None:
    analog = np.column_stack([bursts(1e-3) + 0.5 + 0.01 * np.sin(2 * np.pi * TIME), 0 * TIME, 1e-5 * bursts(1e-3)])
    (one,) = emg_envelopes(analog, RATE, ("L Sol", "R Sol", "R TA"), ("V", "V", "V"))
    assert (one.muscle, one.side, one.unit) == ("soleus", "left", "mV")
    loud = one.value[(one.time > 1.2) & (one.time < 1.8)]
    assert loud.mean() == pytest.approx(np.sqrt(2 / np.pi), rel=0.15)  # the mean of rectified noise of 1 mV
    assert one.value[(one.time < 0.8) | (one.time > 2.2)].max() < 0.1


def test_what_is_sampled_too_slowly_is_none() -> None:
    assert emg_envelopes(bursts(1.0)[:, None], 200.0, ("L Sol",), ("V",)) == ()


def test_a_rectified_channel_keeps_its_size() -> None:
    (one,) = emg_envelopes(np.abs(np.sin(40 * TIME))[:, None], RATE, ("L Sol",), ("mV",))
    assert one.value[1000:3000].mean() == pytest.approx(2 / np.pi, abs=0.02)


def test_a_gait_cycle_has_the_muscles_of_its_own_leg() -> None:
    emg = emg_envelopes(np.column_stack([bursts(1.0), bursts(2.0)]), RATE, ("L Sol", "R Sol"), ("mV", "mV"))
    outputs = FileOutputs({}, (), emg=emg)
    walk, squat = Cycle("t", "gait", "left", 0.5, 1.5, 1.1), Cycle("t", "squat", "both", 0.5, 2.5, 1.5)
    assert [(one.quantity, one.side) for one in emg_curves(walk, outputs)] == [("soleus_emg", "left")]
    assert [one.side for one in emg_curves(squat, outputs)] == ["left", "right"]
    assert list(emg_curves(Cycle("t", "gait", "left", 3.5, 4.5, 4.1), outputs)) == []
