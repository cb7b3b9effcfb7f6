"""What the search for an added mass found, and what a diagnosis says beside it: made by hand, no session."""

import numpy as np

from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.identification.added_mass import MASSES, LoadCandidate, LoadPosterior, LoadSearch

PLACE = np.array([0.01, -0.12, 0.02])
NOTHING = Diagnosis(True, ())
GAIN = Finding("plate_gain", "Fz", (Estimate("gain", 0.04, 0.01, "1"),), (Alias("plate_gain", "Fz", 9.0),), 0.2)
OWN = Finding(
    "added_mass", "left_thigh", (Estimate("mass", 1.9, 0.2, "kg"),), (Alias("added_mass", "left_thigh", 30.0),), 0.1
)


def found(*shares: tuple[str, float], lies_on: str = "", doubts: tuple[str, ...] = ()) -> LoadSearch:
    """Return the search that found 2.4 kg on segments with these probabilities."""
    weight = np.exp(-0.5 * ((MASSES - 2.4) / 0.3) ** 2) * np.gradient(MASSES)
    posterior = LoadPosterior(0.0, weight / weight.sum())
    suspects = tuple(LoadCandidate(name, posterior, PLACE, 0.1 * PLACE, 20.0, p, 0.8) for name, p in shares)
    return LoadSearch(suspects, 1e-6, "session before", doubts, lies_on)
