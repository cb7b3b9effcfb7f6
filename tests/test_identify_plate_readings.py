"""What fitted trials tell of their plates: known errors come back in kept movement, sound plates stay sound."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from identify_trials import noisy_fit, person, smooth_motion

from biodance.body.human.human import human
from biodance.identification.identification import Identification, identify_body
from biodance.identification.mismatch import mismatch
from biodance.identification.statistics import Fit, statistics
from biodance.identification.validation import PlateReadings, plate_readings, validate
from biodance.motion.dynamics import predict_wrench
from biodance.pipeline.identification import _on_fitted_plates
from biodance.records import Subject, Wrench
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.plates import PLATE_SOURCES, SOURCES, plate_errors, plate_sources

WRONG = {"Fz->Fx": 2.0, "Fz->My": -1.5, "Mz": 2.0}
"""Errors of the plates in their standard deviations."""


def _trial(fit: Fit, size: np.ndarray) -> Fit:
    """Return a trial of which the plates err by ``size`` (49,) about the lab origin."""
    rows = plate_errors(fit.wrench.value, fit.motion.rate, Noise.unit(np.zeros(3)), plate_sources())
    return replace(fit, wrench=Wrench(fit.wrench.time, fit.wrench.value + rows @ size))


def _sizes(wrong: dict[str, float]) -> np.ndarray:
    size = np.zeros(PLATE_SOURCES)
    for k, (_, place) in enumerate(SOURCES):
        size[k] = wrong.get(place, 0.0) if place != "Mz" or SOURCES[k][0].name == "plate_offset" else 0.0
    return size


def _told(seed: int, wrong: dict[str, float], doubt: float = 0.0) -> tuple[Identification, PlateReadings, Fit, Fit]:
    """Return the body of a fitted trial, what it tells of the plates, that trial, and one of the same plates that was
    kept; ``doubt`` standard deviations (10 N of Fy) are left of a correction.
    """
    body, rng = human(Subject(70.0, 1.75, "M", 30.0)), np.random.default_rng(seed)
    fit, kept = (
        _trial(noisy_fit(body, smooth_motion(body, rng, frames=1500, size=0.3), body.sip.phi, rng), _sizes(wrong))
        for _ in range(2)
    )
    if doubt:
        doubts = np.zeros((1500, 6, 1))
        doubts[:, 1] = 10.0
        fit, kept = (
            replace(f, doubts=doubts, wrench=Wrench(f.wrench.time, f.wrench.value + doubt * doubts[:, :, 0]))
            for f in (fit, kept)
        )
    found = identify_body(body, (fit,))
    return found, *plate_readings(found, (fit,), found.identified), fit, kept


def _left(fit: Fit, found: Identification, plates: PlateReadings | None = None) -> np.ndarray:
    """Return (6,) the mean that the identified body leaves, with or without what the plates add."""
    added = plates.added(fit, found.identified) if plates else 0.0
    return np.asarray((fit.wrench.value - added - predict_wrench(found.identified, fit.motion).value).mean(axis=0))


@pytest.mark.parametrize("seed", [1, 2])
def test_errors_of_the_plates_are_taken_off_movement_that_was_kept(seed: int) -> None:
    found, plates, _, kept = _told(seed, WRONG)
    before, after = (np.abs(_left(kept, found, told)) for told in (None, plates))
    weight = 9.81 * found.sip.mass.sum()
    assert before[0] > 0.003 * weight
    assert after[0] < 0.3 * before[0]
    assert after[5] < 0.7 * before[5]


def test_sound_plates_are_hardly_touched() -> None:
    for seed in (4, 5):
        found, plates, fit, kept = _told(seed, {})
        moved = plates.added(kept, found.identified)
        rows = plates.rows(kept, found.identified)
        allowed = np.sqrt(np.mean(np.einsum("tci,ij,tcj->tc", rows, np.eye(rows.shape[2]), rows), axis=0))
        assert np.all(np.sqrt(np.mean(moved**2, axis=0)) < 0.2 * allowed)
        assert np.abs(plates.size).max() < 1.0
        assert "Fx" not in plates.told((fit,), found.identified)


def test_what_is_told_holds_the_truth() -> None:
    found, plates, fit, _ = _told(1, WRONG)
    said = plates.told((fit,), found.identified)
    assert said.startswith("Fx +")
    value, reach = (float(word) for word in said.removeprefix("Fx ").split(" N")[0].split(" ± "))
    rows = plate_errors(predict_wrench(found.identified, fit.motion).value, 100.0, plates.layout, plate_sources())
    true = plates.layout.shift @ (rows @ _sizes(WRONG)).mean(axis=0)
    assert abs(value - true[0]) < 1.5 * reach


def test_what_is_left_of_a_correction_is_taken_off_too() -> None:
    found, plates, fit, kept = _told(7, {}, doubt=2.0)
    assert plates.size.shape == (PLATE_SOURCES + 1,)
    assert abs(_left(kept, found, plates)[1]) < 0.2 * abs(_left(kept, found)[1])
    assert plates.told((fit,), found.identified).startswith("Fy +")
    plain = replace(kept, doubts=np.zeros((0, 6, 0)))
    assert np.isfinite(plates.added(plain, found.identified)).all()


def test_every_body_is_compared_with_what_the_plates_read_beside_it() -> None:
    """A wrong body leaves more to the plates, and is forgiven that: the gain is what is left of it then."""
    found, plates, fit, kept = _told(1, WRONG)
    beside_table, again = plate_readings(found, (fit,), found.body, found.identified)
    np.testing.assert_array_equal(again.size, plates.size, "what one body is told hangs on who is asked beside it")
    about = np.zeros(3)
    one = validate(found.body, found.identified, kept, about=about, plates=(beside_table, plates))
    plain = validate(found.body, found.identified, kept, about=about)
    table, identified = beside_table.added(kept, found.body), plates.added(kept, found.identified)
    np.testing.assert_allclose(one.table.value - plain.table.value, table, atol=1e-9)
    np.testing.assert_allclose(one.identified.value - plain.identified.value, identified, atol=1e-9)
    np.testing.assert_array_equal(one.measured.value, plain.measured.value)
    assert np.linalg.norm(beside_table.size) > np.linalg.norm(plates.size)


def test_of_plates_on_which_no_fitted_trial_stands_nothing_is_told() -> None:
    def trial(name: str, role: str, **newton: float) -> Any:
        plates = tuple(
            SimpleNamespace(name=plate, wrench=SimpleNamespace(value=np.full((5, 6), value)))
            for plate, value in newton.items()
        )
        return SimpleNamespace(name=name, trial=SimpleNamespace(role=role, plates=plates))

    march, squats = trial("march", "fit", p1=700.0, p2=0.0), trial("squats", "validate", p1=650.0, p2=4.0)
    walk = trial("walk", "validate", p1=700.0, p2=800.0)
    assert _on_fitted_plates((march, squats, walk)) == {"march", "squats"}


def test_the_rows_are_those_of_the_scores() -> None:
    body, truth, rng = person(8)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=800), truth, rng)
    noise, p = Noise.unit(np.array([0.1, 0.2, 0.0])), 10 * len(body.segments)
    found = mismatch(body, (fit,), noise, with_rows=True)
    plain = mismatch(body, (fit,), noise)
    assert plain.rows is None
    assert found.rows is not None
    np.testing.assert_allclose(found.plates, plain.plates, rtol=1e-9)
    np.testing.assert_allclose(found.kinematics, plain.kinematics, rtol=1e-9)
    np.testing.assert_allclose(found.rows.normal[:p, p:], found.plates, rtol=1e-9)
    np.testing.assert_allclose(found.rows.kinematics[:p], found.kinematics, rtol=1e-9)
    scale = np.abs(found.rows.normal).max()
    np.testing.assert_allclose(found.rows.normal, found.rows.normal.T, atol=1e-9 * scale)
    whole = statistics(body, (fit,), noise).normal_matrix(noise)
    np.testing.assert_allclose(found.rows.normal[:p, :p], whole[:p, :p], rtol=1e-6, atol=1e-9 * np.abs(whole).max())
    np.testing.assert_allclose(found.rows.target[:p], whole[:p, p], rtol=1e-6, atol=1e-9 * np.abs(whole).max())
