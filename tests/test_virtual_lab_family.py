"""Laboratories drawn from a seed: the same for ever, within what is said of them, and readable like any other."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.errors import BiodanceError
from biodance.lab.session.read import read_session
from biodance.virtual_lab.recording.cameras import TISSUES
from biodance.virtual_lab.recording.family import CAMERAS, PLATES, draw_laboratory, draw_visitor, soft_parts
from biodance.virtual_lab.recording.laboratory import Laboratory, LabVisit
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.tolerances import REALISTIC


def test_a_number_is_one_laboratory_and_the_family_is_wide() -> None:
    family = [draw_laboratory(seed) for seed in range(60)]
    assert family[7] == draw_laboratory(7)
    assert {one.tissue for one in family} == set(TISSUES)
    assert {one.plates for one in family} == {1, 2, 3, 4}
    assert {one.segments for one in family} == {12, 14, 16, 18, 20, 22}
    assert {one.joints for one in family} == {"functional", "static"}
    assert {one.children for one in family} == {True, False}
    cameras = np.array([one.tolerances.camera_noise for one in family])
    density = np.array([one.tolerances.plate_noise for one in family]) * np.sqrt(2 / 1000)
    for drawn, (low, high) in ((cameras, CAMERAS), (density, PLATES)):
        assert low <= drawn.min() < 2 * low
        assert high / 2 < drawn.max() <= high
    times = np.log([one.tolerances.plate_gain / REALISTIC.plate_gain for one in family])
    assert np.std(times) == pytest.approx(0.4, abs=0.1)
    assert all((one.tolerances.head_motion == 0) == (one.segments < 14) for one in family)
    assert all(len(soft_parts(one)) == max(0, one.segments - 16) for one in family)
    ages = [draw_visitor(one, 1).age for one in family]
    assert all((age < 16) == one.children for age, one in zip(ages, family, strict=True))


def test_a_drawn_laboratory_records_what_can_be_read(tmp_path) -> None:
    here = replace(draw_laboratory(3), plates=4, plate_type=2, segments=22, tissue="wavy", joints="static")
    who = draw_visitor(here, 1)
    session = read_session(simulate_session(who, "standing", tmp_path / "s", seed=1, visit=LabVisit(laboratory=here)))
    assert session.settings.joints == "static"
    trial = session.trials[0]
    weight = [abs(float(plate.wrench.force[:, 2].mean())) for plate in trial.plates]
    assert sum(weight[:2]) == pytest.approx(9.81 * who.mass, rel=0.02)
    assert max(weight[2:]) < 5


@pytest.mark.parametrize("wrong", [{"plates": 5}, {"tissue": "firm"}, {"segments": 11}, {"plate_type": 3}])
def test_an_impossible_laboratory_is_refused(wrong) -> None:
    with pytest.raises(BiodanceError, match="legal are"):
        Laboratory(**wrong)
