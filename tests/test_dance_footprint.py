"""How much plate a dance needs, and feet that are set to fit on it: recomputed from the soles of each stance."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_dances import BODY, small_dance
from walkers import Stand, plate, walker

from biodance.body.human.human import human
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.problem.footprint import AROUND, room_on_plates
from biodance.dance.problem.plan import LEAST_FORWARD, LEAST_WIDE, USUAL_PLATE, Plan, read_plan
from biodance.dance.problem.stance import STOOL, seat
from biodance.errors import BiodanceError
from biodance.motion.contact.contact import ground_contact
from biodance.pipeline.dance_result import plates_too_small
from biodance.records import Array, Session, Subject

TALL = human(Subject(110.0, 1.80, "M", 45.0))
BOTH = Plan("both", "", (("parallel", 2), ("right_forward", 2)), wide=1.35)


def reach(plan: Plan, body: object = TALL) -> Array:
    """Return (2,) m from side to side and ahead over the soles of all stances of a plan."""
    soles = np.concatenate([one.soles.reshape(-1, 3) for one in support_sequence(body, plan)])
    return np.array([np.ptp(soles[:, 1]), np.ptp(soles[:, 0])])


def test_every_dance_of_people_is_made_for_the_usual_plate_unless_it_says_otherwise(tmp_path: Path) -> None:
    assert read_plan("short").plate == read_plan("full").plate == USUAL_PLATE
    own = tmp_path / "own.toml"
    own.write_text('name = "own"\nplate_m = [0.464, 0.508]\n[postures]\nparallel = 3\n')
    assert read_plan(own).plate == (0.464, 0.508)


def test_the_feet_of_a_tall_person_are_set_on_the_plate_with_room_around_them() -> None:
    free = reach(BOTH)
    assert free[0] + 2 * AROUND > 0.40
    fitted = reach(replace(BOTH, plate=(0.40, 0.60)))
    np.testing.assert_allclose(fitted, [0.40 - 2 * AROUND, free[1]], atol=1e-9)
    shallow = reach(replace(BOTH, plate=(0.60, free[1] + 2 * AROUND - 0.03)))
    np.testing.assert_allclose(shallow, [free[0], free[1] - 0.03], atol=1e-9)


@pytest.mark.parametrize(
    ("sides", "said"),
    [
        (
            (0.60, 0.35),
            r"a plate of 0.6 m from side to side .* as is legal. Let the person face across it \(--plate 0.35,",
        ),
        ((0.25, 0.25), "Use a larger plate, or two plates side by side"),
    ],
)
def test_a_plate_that_is_too_small_is_refused_with_what_the_feet_need(sides: tuple[float, float], said: str) -> None:
    with pytest.raises(BiodanceError, match=said):
        support_sequence(TALL, replace(BOTH, plate=sides))
    narrow = {"wide": LEAST_WIDE} if sides[0] < 0.4 else {}
    least = reach(replace(BOTH, forward=LEAST_FORWARD, **narrow)) + 2 * AROUND
    with pytest.raises(BiodanceError, match=f"{least[0]:.2f} m of force plate from side to side and {least[1]:.2f} m"):
        support_sequence(TALL, replace(BOTH, plate=sides))


@pytest.mark.parametrize("side", [0.19, 3.1, float("nan")])
def test_a_plate_that_is_no_plate_is_refused(side: float) -> None:
    with pytest.raises(BiodanceError, match=r"legal are 0.2 to 3 m"):
        replace(BOTH, plate=(side, 0.6))


@pytest.mark.parametrize("given", ["0.4", "[0.4]", '["a", 0.6]', "[0.4, nan]"])
def test_a_wrong_plate_in_a_protocol_is_refused(tmp_path: Path, given: str) -> None:
    path = tmp_path / "p.toml"
    path.write_text(f"plate_m = {given}\n[postures]\nparallel = 3\n")
    with pytest.raises(BiodanceError, match="plate_m"):
        read_plan(path)


def test_a_stool_needs_the_place_of_its_legs() -> None:
    np.testing.assert_allclose(room_on_plates([seat(BODY)]), np.ptp(STOOL, axis=0)[::-1])


def session(*spans: tuple[float, float], role: str = "fit") -> Session:
    """Return a session of one trial with plates of 0.6 m along y, and these spans m along x."""
    plates = [plate(f"plate{k}", span, (-0.3, 0.3)) for k, span in enumerate(spans)]
    trial = walker([Stand(0, 1, (0.1, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], plates, duration=1.0)[0]
    return Session("S", (replace(trial, role=role),), Subject(65.0, 1.75, "F"))


def test_plates_too_small_for_a_dance_are_told_and_others_are_not() -> None:
    dance = small_dance()
    need = np.sort(room_on_plates(dance.stances))
    assert need[1] < 0.6
    assert plates_too_small(dance, session((0.0, need[0] + 0.002))) == ""
    said = plates_too_small(dance, session((0.0, need[0] - 0.01)))
    assert f"cover {need[0] - 0.01:.2f} m by 0.60 m" in said
    assert "--plate" in said
    half = need[0] / 2
    assert plates_too_small(dance, session((0.0, half), (half, 2 * half + 0.002))) == "", "two that touch"
    assert plates_too_small(dance, session((0.0, 0.1), role="skip")) == ""


def test_how_far_a_foot_stands_beside_the_plate_is_told() -> None:
    def notes(inwards: float) -> list[str]:
        both = [Stand(0, 1, (0.1 + inwards, -0.1, 0))], [Stand(0, 1, (0.1 + inwards, 0.1, 0))]
        trial, soles, *_ = walker(*both, [plate("plate1", (0.0, 0.6), (-0.3, 0.3))], duration=1.0)
        over = float(min(soles.outline[..., 0].min(), 0.6 - soles.outline[..., 0].max()))
        found = [note for note in ground_contact(trial, soles).notes if "beyond their edge" in note]
        assert bool(found) == (over < 0)
        told = [float(note.split("reaches ")[1].split(" mm")[0]) for note in found]
        assert told == pytest.approx([-1000 * over] * len(found), abs=1.0), "whole millimetres"
        return found

    assert len(notes(0.1)) == 0
    assert len(notes(0.3)) == 2
    assert len(notes(-0.15)) == 2
