"""What is left of a session without fault is called normal, however short the session is."""

from dataclasses import replace

import numpy as np
from diagnosed_sessions import RATE, body, known, looks

from biodance.diagnose.adequacy import LIMIT, adequacy
from biodance.diagnose.naming import built
from biodance.diagnose.problem import problem


def test_chance_spreads_more_in_a_short_session() -> None:
    """Three seconds hold one coefficient below 0.3 Hz: its square is more than seven times the mean in one of 150."""
    worst = []
    for seed in range(12):
        look = looks(seed, trials=1)[0]
        use = np.zeros(look.use.size, dtype=bool)
        use[int(2 * RATE) : int(5 * RATE)] = True
        found, _ = built(problem(body(), (replace(look, use=use),)), known(), ("plate_offset",))
        worst.append(adequacy(found)[0].z)
    assert max(worst) < LIMIT
    assert max(worst) > 1.0, "the rows still spread"
