"""Joint moments take an identified body only where trials kept from the fit prove it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from identified_sessions import session_result

from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.movement import describe_movement
from biodance.pipeline.results import SessionResult


def with_gain(force: tuple[float, float], moment: tuple[float, float]) -> SessionIdentification:
    """Return an identification whose gain on the kept trials has the given intervals."""
    found = session_result().identification
    assert found.gain is not None
    return replace(found, gain=replace(found.gain, force_interval=force, moment_interval=moment))


def test_kept_trials_prove_a_body() -> None:
    found = session_result().identification
    assert found.gain.force_interval[0] > 1
    assert found.proven is found.identification.sip
    assert describe_movement(session_result()).parameters == "identified"


@pytest.mark.parametrize(("force", "moment"), [((0.9, 1.4), (1.2, 2.0)), ((1.1, 1.4), (0.98, 2.0))])
def test_an_interval_that_holds_one_proves_nothing(force: tuple[float, float], moment: tuple[float, float]) -> None:
    assert with_gain(force, moment).proven is None


def test_without_kept_trials_nothing_is_proven() -> None:
    result = session_result(roles=("fit",))
    assert result.identification.status == "solved"
    assert result.identification.proven is None
    moved = describe_movement(result)
    assert (moved.parameters, moved.mass) == ("table", pytest.approx(62.0))


def test_clinical_walks_without_kept_trials_use_the_table(recording: Callable[[str], SessionResult]) -> None:
    """Five walks of a patient were all fitted: trunk and head came out at 13.5 kg, where the table has 19.7."""
    result = recording("c3d_parser_Sydney")
    moved = describe_movement(result)
    assert result.identification is not None
    assert moved.parameters == "table"
    assert moved.mass == pytest.approx(53.5)
    assert np.isfinite(moved.mass)
