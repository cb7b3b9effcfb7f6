"""A plate's zero is an error, not noise: what looks like it is hidden by it, however little noise there is."""

from diagnosed_sessions import body, known, offset, windows
from inferred_sessions import inferred

from biodance.uncertainty.session_noise import of_zeros, with_zeros


def test_what_looks_like_a_zero_is_seen_less_the_more_zeros_differ() -> None:
    some, spread = windows(1, trials=2, hidden=offset(40.0)), of_zeros([12.0, 12.0])
    sure, wide = (
        inferred(body(), some, tolerances=one, effects=("plate_offset",)).diagnosis.findings[0]
        for one in (known(), with_zeros(known(), spread, 70.0))
    )
    assert wide.parameters[0].sd > sure.parameters[0].sd
    assert wide.visible_fraction < sure.visible_fraction
