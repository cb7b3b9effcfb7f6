"""Jumps found and told by height, flight and depth, on movements made by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from biodance.cycles.cut import jumps
from biodance.cycles.strides import lift
from biodance.records import Plate, Wrench

RATE, WEIGHT, G = 100.0, 600.0, 9.81
TIME = np.arange(0, 4, 1 / RATE)
OFF, FLIGHT = 2.0, 0.4
"""s: take-off, and until the landing."""


def path(start_height: float = 1.0) -> np.ndarray:
    """Height (T,) m of a centre of mass that goes down by 0.3 m, up, and flies for 0.4 s."""
    speed = G * FLIGHT / 2
    air = TIME - OFF
    flies = 1.05 + speed * air - G * air**2 / 2
    ground = np.interp(TIME, [0, 1, 1.5, OFF], [start_height, start_height, 0.7, 1.05])
    after = np.interp(TIME, [OFF + FLIGHT, 2.8, 3.4], [1.05, 0.8, 1.0])
    return np.where(TIME < OFF, ground, np.where(TIME < OFF + FLIGHT, flies, after))


def feet_high(lift_left: float = 0.0) -> np.ndarray:
    """Height (T, 2) m of both soles: off the ground in the flight, the left one sooner by ``lift_left`` s."""
    off = np.array([OFF, OFF - lift_left])
    air = (TIME[:, None] > off) & (TIME[:, None] < OFF + FLIGHT)
    share = np.clip(np.minimum(TIME[:, None] - off, OFF + FLIGHT - TIME[:, None]) / 0.03, 0, 1)
    return np.where(air, 0.12 * share, 0.0)


KNOWN = np.ones((TIME.size, 2), dtype=bool)


def found(
    height: np.ndarray, soles: np.ndarray, *, feet: Any = None, known: np.ndarray = KNOWN, plates: tuple = ()
) -> tuple:
    motion = SimpleNamespace(time=TIME, rate=RATE, determined=np.ones(TIME.size, dtype=bool))
    outline = np.zeros((TIME.size, 2, 3, 3))
    outline[..., 2] = soles[:, :, None]
    centre = np.stack([0 * TIME, 0 * TIME, height], axis=1)
    return jumps("jump", motion, SimpleNamespace(outline=outline), centre, feet, known, plates)


def feet(right: np.ndarray, left: np.ndarray) -> dict[str, Wrench]:
    return {
        f"{side}_foot": Wrench(TIME, np.stack([0 * TIME, 0 * TIME, force, *np.zeros((3, TIME.size))], axis=1))
        for side, force in (("right", right), ("left", left))
    }


def test_a_jump_goes_from_the_way_down_to_the_landing() -> None:
    (one,) = found(path(), feet_high())
    assert one.kind == "jump"
    assert one.start == pytest.approx(1.05, abs=0.02)  # a tenth of the way down
    assert one.off == pytest.approx(OFF, abs=0.02)
    assert one.end == pytest.approx(OFF + FLIGHT, abs=0.02)


def test_the_plates_tell_when_the_feet_leave_the_ground_and_land() -> None:
    force = np.where((TIME > OFF + 0.03) & (TIME < OFF + FLIGHT + 0.04), 0.0, 300.0)
    (one,) = found(path(), feet_high(), feet=feet(force, force), known=KNOWN)
    assert one.off == pytest.approx(OFF + 0.035, abs=0.01)
    assert one.end == pytest.approx(OFF + FLIGHT + 0.035, abs=0.01)
    (one,) = found(path(), feet_high(), feet=feet(force, force), known=~KNOWN)
    assert one.off == pytest.approx(OFF, abs=0.02)


def test_the_recorded_force_tells_when_a_low_passed_one_is_early_and_late() -> None:
    """The right foot leaves last and lands first, each on a plate of its own; other contacts do not count."""
    force = np.where((TIME > OFF + 0.03) & (TIME < OFF + FLIGHT - 0.03), 0.0, 300.0)
    loaded = [[0.2, OFF + 0.004], [OFF + FLIGHT + 0.001, 3.5]], [[0.2, OFF - 0.01], [OFF + FLIGHT + 0.02, 3.5]]
    plates = tuple(
        Plate(f"plate{k}", 2, np.zeros((4, 3)), feet(force, force)["right_foot"], loaded=own)
        for k, own in enumerate(loaded)
    )
    (one,) = found(path(), feet_high(), feet=feet(force, force), plates=plates)
    assert (one.off, one.end) == (OFF + 0.004, OFF + FLIGHT + 0.001)


def test_height_flight_depth_and_share_are_those_put_in() -> None:
    (one,) = found(path(), feet_high())
    centre = np.stack([0 * TIME, 0 * TIME, path()], axis=1)
    sure = np.ones(TIME.size, dtype=bool)
    told = lift(one, centre, TIME, WEIGHT, feet(400 + 0 * TIME, 200 + 0 * TIME), sure).values
    assert told["height"] == pytest.approx(G * FLIGHT**2 / 8, abs=0.01)
    assert told["flight_time"] == pytest.approx(FLIGHT, abs=0.03)
    assert told["depth"] == pytest.approx(0.27, abs=0.02)
    assert told["share_right"] == pytest.approx(100 * 400 / 600)
    one_plate = lift(one, centre, TIME, WEIGHT, feet(400 + 0 * TIME, 200 + 0 * TIME), ~sure, sure).values
    assert "share_right" not in one_plate
    assert one_plate["force_rise"] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("height", "soles"),
    [
        (path(), feet_high(lift_left=0.3)),  # runs: one foot is in the air long before
        (path(), 0 * feet_high()),  # comes up on the toes
        (0 * TIME + 1.0, feet_high()),  # lifts its feet, as who hangs
    ],
)
def test_who_runs_or_does_not_fly_does_not_jump(height: np.ndarray, soles: np.ndarray) -> None:
    assert found(height, soles) == ()


def test_a_drop_begins_with_its_landing() -> None:
    """From a box of 0.3 m, left with both feet at 0.8 s, to the ground at 1 s."""
    high = np.where(TIME < 1.0, 0.3, feet_high()[:, 0])[:, None] * np.ones(2)
    (one,) = found(path(1.3), high)
    assert one.start == pytest.approx(1.0, abs=0.1)
