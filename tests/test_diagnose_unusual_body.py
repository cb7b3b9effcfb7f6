"""Names beside a body that is more unlike the table than people are."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosed_sessions import body, delay, known, nothing, windows

from biodance.diagnosis.adequacy import CONFLICT_LIMIT, prior_data_conflict
from biodance.diagnosis.engine import diagnose_trials
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.naming import Round
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.screening import ScoredCandidate
from biodance.diagnosis.unusual_body import robust_causes, with_inflated_prior
from biodance.effects import effects

family = effects()
CAUSES = ("time_delay", "plate_offset", "added_mass", "body_mass")


def diagnosed(hidden, *, unlike: float, trials: int = 4, tolerances=None):
    some = windows(1, hidden=hidden, unlike=unlike, trials=trials)
    return diagnose_trials(body(), some, tolerances=tolerances or known(), effects=CAUSES)


def test_a_delay_is_named_however_strange_the_body_is_and_a_strange_body_alone_is_not() -> None:
    strange = diagnosed(delay, unlike=4.0)
    assert prior_data_conflict(strange.naming.found) > CONFLICT_LIMIT
    assert strange.diagnosis.verdict == "named, incomplete"
    assert Reason.UNUSUAL_BODY in strange.diagnosis.reasons
    (finding,) = strange.diagnosis.findings
    (size,) = finding.parameters
    assert finding.effect == "time_delay"
    assert size.interval[0] < 0.02 < size.interval[1]
    alone = diagnosed(delay, unlike=6.0, trials=1)
    assert prior_data_conflict(alone.naming.found) > CONFLICT_LIMIT
    assert not alone.diagnosis.findings, "one trial does not show that the delay is the same in another one"
    clean = diagnosed(nothing, unlike=4.0).diagnosis
    assert clean.verdict == "unexplained"
    assert not clean.findings


def test_a_size_that_is_hardly_known_is_no_name_beside_a_strange_body() -> None:
    """Delays that are unlike their model by 60 % of their size are seen as surely, and told as 20 ± 12 ms."""
    one = diagnosed(delay, unlike=4.0, tolerances=replace(known(), accuracy={"time_delay": 0.6})).diagnosis
    assert not one.findings
    (like,) = one.resembles
    assert like.effect == "time_delay"
    assert not like.parameters[0].known


def test_the_prior_is_widened_as_far_as_the_body_is_strange_and_never_narrowed() -> None:
    wide, usual = (diagnosed(nothing, unlike=size).naming.bare for size in (4.0, 0.7))
    assert prior_data_conflict(wide) > CONFLICT_LIMIT > abs(prior_data_conflict(with_inflated_prior(wide)))
    np.testing.assert_array_equal(with_inflated_prior(usual).posterior.X, usual.posterior.X)
    assert with_inflated_prior(usual).log_likelihood == pytest.approx(usual.log_likelihood)


@pytest.mark.parametrize(
    ("name", "score", "stands"),
    [
        ("plate_drift", 31.0, True),
        ("plate_drift", 29.0, False),
        ("trunk_joint", 1e4, False),
        ("plate_crosstalk", 1e4, False),
    ],
)
def test_a_joint_that_the_model_lacks_is_no_excuse_for_a_strange_body(name: str, score: float, stands: bool) -> None:
    effect = replace(family[name], target="Fx")
    touch = NamedCause(effect, np.ones(1), np.eye(1), {"t0": np.ones(3)})
    by = Round((ScoredCandidate(effect, score, score, np.zeros(0), 1.0),))
    found = SimpleNamespace(problem=SimpleNamespace(cases=(1, 2)), tolerances=known(), named=(touch,))
    assert robust_causes(found, (by,)) == ({(name, "Fx")} if stands else set())
