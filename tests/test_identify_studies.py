"""The masses beforehand: the table's, or those of the published studies together, as probable as the session makes
them.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from biodance.body.body import Body
from biodance.body.body_file import body_text, parse_body
from biodance.body.human.girths import published_fractions
from biodance.body.human.human import human
from biodance.body.human.skeleton import kind_of
from biodance.identification.information import Information
from biodance.identification.placement import more_probable_table, studies_share, with_studies
from biodance.records import Sip, Subject
from biodance.uncertainty.caution import widened

PERSON = Subject(70.0, 1.75, "M")


@cache
def person() -> Body:
    """Return a man whose table is de Leva's."""
    return human(PERSON)


def shown(masses: np.ndarray, sd: float) -> Information:
    """Return data that show all ``masses`` (12,) kg to ``sd`` kg each."""
    rows = np.zeros((12, 121))
    rows[np.arange(12), 10 * np.arange(12)] = 1 / sd
    rows[:, -1] = masses / sd
    return Information(np.linalg.qr(np.vstack([rows, np.zeros((121, 121))]), mode="r"), 12)


def studied() -> np.ndarray:
    """Return the masses (12,) kg of the studies' mean man."""
    mean = np.array([np.mean(published_fractions(kind_of(name), PERSON)) for name in person().segments])
    return PERSON.mass * mean / mean.sum()


def test_the_second_opinion_is_the_mean_of_the_studies_and_only_of_adults_whom_nobody_measured() -> None:
    body = person()
    assert sum(body.studies) == pytest.approx(1.0)
    np.testing.assert_allclose(PERSON.mass * np.array(body.studies), studied())
    assert studied()[0] > body.sip.mass[0]  # every study but Zatsiorsky's has a heavier pelvis
    assert human(replace(PERSON, age=10.0, stature=1.3, mass=30.0)).studies == ()
    assert human(PERSON, table="zatsiorsky_2002").studies == ()
    assert human(replace(PERSON, girths={"thigh": 0.55})).studies == ()
    assert parse_body(body_text(body, "here"), "here")[0].studies == body.studies


def test_masses_move_as_far_as_the_session_makes_the_studies_probable() -> None:
    body = person()
    table = widened(body.sip)
    ends = {"table": np.array(body.sip.mass), "studies": studied()}
    shares = {}
    for name, masses in ends.items():
        found, _, words = more_probable_table(shown(masses, 0.3), table, body)
        shares[name] = studies_share(found, body)
        assert f"{100 * shares[name]:.0f} % of the way" in words[-1]
        wanted = ends["table"] + shares[name] * (ends["studies"] - ends["table"])
        np.testing.assert_allclose(found.mass, wanted)
        np.testing.assert_allclose(found.com, table.com, atol=1e-12)
        assert found.mass.sum() == pytest.approx(PERSON.mass)
    assert shares["table"] < 0.4 < 0.6 < shares["studies"]
    nothing = more_probable_table(shown(ends["table"], 1e4), table, body)[0]
    assert studies_share(nothing, body) == pytest.approx(0.5, abs=1e-3)


def test_between_two_opinions_mean_and_variance_are_those_of_drawing_one_of_them() -> None:
    body, share, rng = person(), 0.3, np.random.default_rng(1)
    table = widened(body.sip)
    found = with_studies(table, body, share)
    drawn = np.where(rng.random(200_000) < share, studied()[0], body.sip.mass[0])
    assert found.mass[0] == pytest.approx(drawn.mean(), rel=1e-3)
    assert found.covariance[0, 0] - table.covariance[0, 0] == pytest.approx(drawn.var(), rel=0.01)
    total = np.tile(np.eye(10)[0], 12)
    assert total @ found.covariance @ total == pytest.approx(total @ table.covariance @ total)
    back = with_studies(found, body, 0.0)
    np.testing.assert_allclose(back.phi, table.phi)
    np.testing.assert_allclose(back.covariance, table.covariance, atol=1e-12)


def test_what_is_known_before_has_no_second_opinion() -> None:
    body = person()
    given = Sip(body.segments, body.sip.phi, body.sip.covariance)
    blank = shown(studied(), 0.3)
    assert studies_share(given, body) == 0.0
    assert more_probable_table(blank, given, replace(body, studies=()))[0] is given
    assert with_studies(given, body, 0.0) is given
