"""The mains hum in a channel: 50 or 60 Hz from a missing earth, a broken screen, a lamp."""

import numpy as np

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, unit_of
from biodance.effects._base.words import About, CauseWords
from biodance.records import CHANNELS, Array, Trial
from biodance.spatial import wrench_about_point

MAINS = (50.0, 60.0)
_LEAST = np.array([2.0, 2.0, 2.0, 0.6, 0.6, 0.6])
"""N, N·m: a smaller amplitude harms nothing."""
_CLEARLY = 3.0
"""Times the largest amplitude beside it by which the line must stand out: steps at an even pace make a comb of lines, a
motor lines of its own (59.7 Hz of a treadmill, 1.1 N·m).
"""
_WANDERS = 0.1
"""Hz: grids are held to within 0.05 Hz of 50 and 60 (ENTSO-E), seldom farther than 0.1."""
_BESIDE = 8.0
"""Hz on either side with which the line is compared."""
_SECONDS = 2.0


class MainsHum(DiscreteEffect):
    """A line of the mains in a channel of a plate."""

    name = "mains_hum"
    separated_by = "A recording of the empty plate."
    advice = (
        "Check earth and screens of the cables; keep them away from mains cables and lamps. Forces below 10 Hz "
        "are not touched."
    )
    about = About(
        what="The mains hum in a channel: 50 or 60 Hz from a missing earth, a broken screen, a lamp.",
        signature="A narrow line at 50 or 60 Hz that is there when nobody moves.",
        look_alikes="Vibration of a treadmill motor or a building, at other frequencies.",
        settled_by=(
            "A recording of the empty plate. After the low-pass nothing is left of it, unless it was sampled so "
            "slowly that it was folded into the movement."
        ),
    )
    words = CauseWords("the mains hum in {it}, {size}", "Ground the amplifier, and record again.", "hum")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check per channel that hums in most trials, or one that says none does."""
        seen: dict[tuple[str, float], list[float]] = {}
        trials = 0
        for trial in recorded.session.trials:
            amplitudes = lines(trial)
            trials += bool(amplitudes)
            for key, amplitude in amplitudes.items():
                seen.setdefault(key, []).append(amplitude)
        checks = []
        for (target, frequency), amplitudes_seen in seen.items():
            middle = float(np.median(amplitudes_seen))
            if middle > _LEAST[CHANNELS.index(target.rpartition(":")[2])]:
                said = f"{target} hums at {frequency:g} Hz with an amplitude of {middle:.2g}."
                checks.append(
                    QualityCheck("mains hum", False, said, cls.name, target, middle, "amplitude", unit_of(target))
                )
        none = (QualityCheck("mains hum", True, "No channel of the plates hums at 50 or 60 Hz."),) if trials else ()
        return tuple(checks) or none


def lines(trial: Trial) -> dict[tuple[str, float], float]:
    """Return the amplitude (N, N·m) by channel and frequency (Hz) of the mains; 0 where no line stands over its
    neighbours.
    """
    found = {}
    for plate in trial.plates:
        rate = plate.wrench.rate
        if not (rate > 2 * (max(MAINS) + 10) and plate.wrench.time.size > _SECONDS * rate):
            continue  # it cannot show 60 Hz and its neighbours
        channels = wrench_about_point(plate.wrench.value, plate.centre)
        for frequency in MAINS:
            amplitude, beside = line(channels, rate, frequency)
            for k, name in enumerate(CHANNELS):
                target = name if len(trial.plates) == 1 else f"{plate.name}:{name}"
                found[target, frequency] = float(amplitude[k]) if amplitude[k] > _CLEARLY * beside[k] else 0.0
    return found


def line(values: Array, rate: float, frequency: float) -> tuple[Array, Array]:
    """Return the amplitude (n,) of the line at ``frequency``, and the largest one beside it."""
    window = np.hanning(len(values))
    spectrum = (
        2
        # A sine of amplitude A has |X| = A sum(window) / 2 at its frequency.
        * np.abs(np.fft.rfft(np.nan_to_num(values - np.nanmean(values, axis=0)) * window[:, None], axis=0))
        / window.sum()
    )
    away = np.abs(np.fft.rfftfreq(len(values), 1 / rate) - frequency)
    # Half the width of a line under this window: two bins.
    own = away < _WANDERS + 2 * rate / len(values)
    return spectrum[own].max(axis=0), spectrum[~own & (away < _BESIDE)].max(axis=0)


EFFECT = MainsHum
