"""What a finding gains on trials that were not used to find it."""

from dataclasses import dataclass, field

import numpy as np

from biodance.records import Array, freeze


@dataclass(frozen=True, eq=False)
class Gain:
    """What a finding gains on trials that were not used to find it: all findings accepted, against all but this one
    with the rest fitted again (a single one: against the model in use, identified body and nominal laboratory).

    ``rms_before``, ``rms_after`` (6,) N, N·m, root mean square residual per channel; ``channels`` (6, 2) 95 % interval
    of the share of it that the finding removes (0.2 = a fifth, negative = it adds); ``ci95`` (2,) the same for all
    channels together, each in units of what the accepted model leaves of the trials that were used (excludes 0: a
    proven gain); ``score``, ``score_se`` change of the log predictive density per second, natural logarithm, with
    standard error; ``trials`` judged on.
    """

    rms_before: Array
    rms_after: Array
    ci95: tuple[float, float]
    trials: tuple[str, ...]
    score: float = float("nan")
    score_se: float = float("nan")
    channels: Array = field(default_factory=lambda: np.full((6, 2), np.nan))

    def __post_init__(self) -> None:
        freeze(self, "Gain", channels=(6, 2), rms_before=(6,), rms_after=(6,))

    @property
    def proven(self) -> bool:
        """Whether the interval excludes zero."""
        return self.ci95[0] > 0
