"""An earlier body or reference session of somebody else is refused, and a session is no reference of itself."""

from dataclasses import replace

import numpy as np
import pytest
from identified_sessions import SUBJECT, session_result

import biodance
from biodance.body.human.human import human
from biodance.cli import run
from biodance.errors import SessionRefused
from biodance.pipeline.body import refuse_another_reference, starting_from


def _person(*, stature: float, mass: float = SUBJECT.mass):
    """Return the generic body of somebody else, with the uncertainty that an identified one has."""
    one = human(replace(SUBJECT, stature=stature, mass=mass))
    count = one.sip.phi.size
    return replace(one, sip=replace(one.sip, covariance=1e-4 * np.eye(count)))


def test_a_body_with_other_legs_is_of_another_person() -> None:
    mine = _person(stature=1.70)
    assert starting_from(_person(stature=1.74), mine, SUBJECT.mass, "")[0].sip.mass.sum() == pytest.approx(62.0)
    for stature in (1.60, 1.80):  # 6 % shorter or taller at the same mass
        with pytest.raises(SessionRefused, match=r"0\.\d\d m are measured here: it is of another person"):
            starting_from(_person(stature=stature), mine, SUBJECT.mass, "")


def test_a_reference_of_another_person_is_refused() -> None:
    mine = _person(stature=1.70)
    refuse_another_reference(_person(stature=1.70, mass=45.0), mine, 62.0, "S00")  # 17 kg may be carried
    with pytest.raises(SessionRefused, match="session S00, has legs of"):
        refuse_another_reference(_person(stature=1.85), mine, 62.0, "S00")
    with pytest.raises(SessionRefused, match=r"somebody of 92\.0 kg, 62\.0 kg are declared here"):
        refuse_another_reference(_person(stature=1.70, mass=92.0), mine, 62.0, "S00")


def test_a_visit_is_not_compared_with_another_persons() -> None:
    mine = session_result()
    assert mine.identification is not None
    found = mine.identification.identification
    tall = replace(found, body=_person(stature=1.85))
    with pytest.raises(SessionRefused, match="another person"):
        biodance.identify(mine, reference=replace(mine.identification, name="S00", identification=tall))


def test_a_session_is_no_reference_of_itself(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    visit = tmp_path / "visit"
    visit.mkdir()
    assert run(["identify", str(visit), "--reference", str(visit / ".." / "visit"), "--out", str(tmp_path / "o")]) == 2
    assert "is itself the --reference" in capsys.readouterr().err
