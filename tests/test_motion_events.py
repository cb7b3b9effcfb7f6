"""A foot comes down where the force passes 20 N, and only where that is the foot's own force."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.cycles.cut import foot_events, that_may_touch, under_both_feet
from biodance.motion.contact import Contact
from biodance.records import FootEvent, Plate, Wrench, contacts

TIME = np.arange(200) / 100


def walked(*, measured=True, shared=False):
    """Right foot from 0.405 to 1.2 s with a slope of 200 N a frame, left foot always in the air."""
    force = np.interp(TIME, [0.395, 0.435, 1.165, 1.205], [0, 800, 800, 0], left=0, right=0)
    value = np.zeros((200, 6))
    value[:, 2] = force
    on = np.zeros((200, 2, 2), dtype=bool)
    on[:, 0, 0] = force > 0
    on[:, 1, 0] = shared
    sure = np.full(200, measured)
    contact = Contact(TIME, on.any(axis=2), on, sure, np.zeros((200, 2)), (), np.stack([sure, sure], axis=1))
    plates = [Plate(f"plate{k + 1}", 2, np.zeros((4, 3)), Wrench(TIME, (1 - k) * value)) for k in range(2)]
    return {"right_foot": Wrench(TIME, value), "left_foot": Wrench(TIME, np.zeros((200, 6)))}, contact, plates


def test_a_step_is_one_strike_and_one_off():
    strike, off = foot_events(*walked())
    assert (strike.side, strike.down, off.side, off.down) == ("right", True, "right", False)
    assert strike.time == pytest.approx(0.392, abs=1e-9)  # 20 N of the 100 N at 0.40 s, after 0.39 s
    assert off.time == pytest.approx(1.208, abs=1e-9)


def test_what_is_not_measured_or_shared_tells_no_event():
    assert foot_events(*walked(measured=False)) == ()
    assert foot_events(*walked(shared=True)) == ()


def test_a_flicker_is_no_event():
    feet, contact, plates = walked()
    value = np.array(feet["right_foot"].value)
    value[80, 2], value[20, 2] = 0.0, 400.0
    assert [event.time for event in foot_events(feet | {"right_foot": Wrench(TIME, value)}, contact, plates)] == [
        pytest.approx(0.392),
        pytest.approx(1.208),
    ]


def test_a_force_that_swings_in_flight_and_toes_that_scrape_are_no_contact():
    """As a low-passed force does between two steps of a runner; 48 of 744 N is a toe that brushes a plate."""
    feet, contact, plates = walked()
    value = np.array(feet["right_foot"].value)
    value[130:140, 2] = 60.0
    swung = Wrench(TIME, value)
    assert np.flatnonzero(contacts(swung))[[0, -1]].tolist() == [40, 120]
    assert foot_events(feet | {"right_foot": swung}, contact, plates) == foot_events(feet, contact, plates)
    assert contacts(Wrench(TIME, 10 * value))[130:140].sum() == 0  # whoever is heavier, too
    value[130:140, 2] = 200.0  # a foot that bears little
    assert contacts(Wrench(TIME, value))[130:140].all()


def test_feet_share_a_plate_only_while_it_carries_something():
    """The feet of a runner are both low while neither touches."""
    _, contact, plates = walked(shared=True)
    everywhere = replace(contact, on_plate=np.ones((200, 2, 2), dtype=bool))
    assert (under_both_feet(everywhere, plates) == contacts(plates[0].wrench)).all()
    assert not under_both_feet(contact, [replace(plates[0], wrench=Wrench(TIME, np.zeros((200, 6)))), plates[1]]).any()


def test_a_leg_that_swings_in_the_air_strikes_nothing():
    contact = walked()[1]  # the right foot touches from 0.40 s on
    strikes = [FootEvent(time, "right", True, "markers") for time in (0.2, 0.35, 0.5)]
    off = FootEvent(0.1, "left", False, "markers")
    assert that_may_touch((off, *strikes), contact) == (off, *strikes[1:])


def test_where_the_recorded_force_passes_the_threshold_it_tells_when():
    """Of the plate under the foot, near by: not of the other one, and not of another step."""
    feet, contact, plates = walked()
    own = replace(plates[0], loaded=[[0.10, 0.20], [0.41, 1.19]])
    strike, off = foot_events(feet, contact, [own, replace(plates[1], loaded=[[0.391, 1.21]])])
    assert (strike.time, off.time) == (0.41, 1.19)
    far = foot_events(feet, contact, [replace(own, loaded=[[0.1, 0.2]]), plates[1]])
    assert far == foot_events(feet, contact, plates)
