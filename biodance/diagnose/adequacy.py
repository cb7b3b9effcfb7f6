"""Is what is left like what sessions without fault leave? The test that may say "unexplained", apart from the search for names."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.diagnose.diagnosis import Adequacy, Verdict
from biodance.diagnose.model import Model
from biodance.diagnose.spectrum import EDGES
from biodance.records import CHANNELS, Array

if TYPE_CHECKING:
    from biodance.effects.gate import Gate

LIMIT = 4.5
"""Standard deviations of null sessions beyond which one band of one channel is not adequate."""
BEYOND = 20.0
"""Standard deviations beyond which a name does not tell the main part."""


def energies(found: Model) -> Array:
    """Return (B, 6): mean square of the whitened residual that is left, per band and channel."""
    band = found.problem.spectrum.band
    square = found.belief.left[: 6 * band.size].reshape(-1, 6) ** 2
    return np.array([square[band == b].mean(axis=0) if (band == b).any() else np.ones(6) for b in range(len(EDGES) - 1)])


def adequacy(found: Model) -> tuple[Adequacy, ...]:
    """Return how far every band of every channel is from null sessions, worst first."""
    spectrum, names = found.problem.spectrum, [case.trial.name for case in found.problem.cases]
    z = (energies(found) - found.tolerances.energy) / found.tolerances.energy_sd
    square = found.belief.left[: 6 * spectrum.band.size].reshape(-1, 6) ** 2
    rows = []
    for b in range(len(z)):
        here = spectrum.band == b
        total = np.array([[square[here & (spectrum.trial == t), c].sum() for c in range(6)] for t in range(len(names))])
        for c in range(6):
            rows.append(Adequacy(CHANNELS[c], (EDGES[b], EDGES[b + 1]), float(z[b, c]), names[int(np.argmax(total[:, c]))]))
    return tuple(sorted(rows, key=lambda row: -row.z))


def verdict(named: int, worst: float, gates: "tuple[Gate, ...]") -> Verdict:
    """Return the verdict from how many causes were named, the ``worst`` z that is left, and the gates."""
    failed = any(not gate.ok for gate in gates)
    if worst <= LIMIT:
        return "named, complete" if named or failed else "nothing wrong"
    if (named or failed) and worst <= BEYOND:
        return "named, incomplete"
    return "unexplained"
