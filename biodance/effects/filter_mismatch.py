"""Forces went through a lower low-pass than the markers: in the amplifier, in the recording software, in an export."""

import numpy as np
from scipy.fft import dct, idct

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.records import Array

REFERENCE = 10.0
"""Hz: the cut-off that a lower one is compared with."""
STRENGTH = 4.0 / REFERENCE**5
"""1/Hz⁵: growth of 1/cutoff⁴ per Hz by which the cut-off lies under the reference."""


class FilterMismatch(Effect):
    """Forces filtered ``cutoff`` Hz lower than the reference of 10 Hz (to first order): zero-phase gain 1 / (1 +
    (f/f_c)⁴ - (f/10)⁴), in which 1/f_c⁴ grows linearly with the parameter. What a report prints is f_c itself.
    """

    name = "filter_mismatch"
    parameters = (
        Parameter(
            "cutoff",
            "Hz",
            4.0,
            "6 Hz against 10 or 45 Hz are in common use (forceandmotion.org abstracts)",
            # Hz that matter, below the filter that is assumed.
            least=0.5,
        ),
    )
    screened_at = (76.0,)  # 3 Hz: at 4 Hz, cameras of 0.3 mm look like a filter of the forces (log evidence 200 to 300)
    separated_by = "Fast alternating movements (arms at 2-3 Hz) against slow ones."
    advice = "Look up the filters of the amplifier and of the recording software; export forces unfiltered."
    about = About(
        what=(
            "Forces went through a lower low-pass than the markers: in the amplifier, in the recording software, in "
            "an export."
        ),
        signature=(
            "The quick part of every channel is missing in proportion to the fourth power of its frequency; holds are"
            " untouched."
        ),
        look_alikes=(
            "A wobbling mass, a delay (where the other filter ran one way only), the inertia of skin under the markers."
        ),
        settled_by="Faster movements, and by the settings of the recording software.",
    )
    words = CauseWords(
        "markers and forces were filtered differently, at {size}{between}", "Filter both alike.", "another filter"
    )
    explains = (CheckKind.FORCES,)

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case whose forces lack what the lower low-pass took."""
        return case.with_added(
            case.trial.plates[0], _passed(case, case.predicted, float(np.ravel(theta)[0])) - case.predicted
        )

    def reported(self, case: Case, theta: Array, sd: Array) -> tuple[tuple[str, float, float, str], ...]:
        """Return the cut-off itself, Hz; its standard deviation to first order."""
        # 1 / fc⁴ grows with the parameter; d fc / d(1 / fc⁴) = -fc / (4 / fc⁴).
        inverse = 1 / REFERENCE**4 + STRENGTH * max(float(theta[0]), 0.0)
        cutoff = inverse**-0.25
        return (("cutoff", cutoff, 0.25 * cutoff / inverse * STRENGTH * float(sd[0]), "Hz"),)

    def reported_size(self, size: float) -> float:
        """Return by how many hertz the cut-off lies under the reference; all of it for an infinite ``size``."""
        return REFERENCE - float(1 / REFERENCE**4 + STRENGTH * size) ** -0.25


def _passed(case: Case, value: Array, lower: float) -> Array:
    """Return ``value`` (T, 6) through a filter whose cut-off lies ``lower`` Hz under the reference, or above it."""
    change = STRENGTH * lower
    # (frequency of the cosine)^4, as of a second-order Butterworth's squared gain.
    steep = (np.arange(len(value)) * case.motion.rate / (2 * len(value))) ** 4
    # Negative changes raise what is fast; beyond the reference by no more than at it.
    gain = 1 / (1 + change * steep) if change >= 0 else 1 - change * np.minimum(steep, REFERENCE**4)
    return np.asarray(idct(gain[:, None] * dct(value, axis=0, norm="ortho"), axis=0, norm="ortho"))


EFFECT = FilterMismatch
