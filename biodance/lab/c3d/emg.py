"""Channels of muscle activity (EMG) in a C3D file: which they are by their labels, and their linear envelope."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.records import Array

_MUSCLES: Mapping[str, str] = {
    "tibialis_anterior": "ta tibant tibialisanterior",
    "tibialis_posterior": "tp tibpost tibialisposterior",
    "gastrocnemius": "gast gas gastroc gastrocnemius",
    "gastrocnemius_medialis": "mg medgast gastmed gasmed gastrocnemiusmedialis",
    "gastrocnemius_lateralis": "lg latgast gastlat gaslat gastrocnemiuslateralis",
    "soleus": "sol soleus",
    "peroneus_longus": "pl per peroneus perlong peroneuslongus",
    "rectus_femoris": "rf rect rectfem rectusfemoris",
    "vastus_lateralis": "vl vlat vastlat vastuslateralis",
    "vastus_medialis": "vm vmed vmo vastmed vastusmedialis",
    "hamstrings": "ham hams hamstrings",
    "medial_hamstrings": "mh medham medhams",
    "lateral_hamstrings": "lh latham lathams",
    "semitendinosus": "st semit semitendinosus",
    "biceps_femoris": "bf bicfem bicepsfemoris",
    "adductors": "add adductor adductors adductorlongus",
    "gluteus_maximus": "gmax glutmax gluteusmaximus",
    "gluteus_medius": "gmed glutmed gluteusmedius",
    "erector_spinae": "es ers erectorspinae",
}
"""Muscle -> what laboratories call it, without side, spaces and signs; names after SENIAM (Hermens et al. 2000,
doi:10.1016/S1050-6411(00)00027-4). What can mean two muscles (GM) is not among them.
"""
_KNOWN = {short: muscle for muscle, names in _MUSCLES.items() for short in names.split()}
_MILLIVOLTS = {"v": 1e3, "mv": 1.0, "uv": 1e-3, "µv": 1e-3, "μv": 1e-3}
_SLOWEST = 500.0
"""Hz: what is sampled slower holds no raw EMG, whose power lies up to 250 Hz and more (Hermens et al. 2000)."""
_HIGH_PASS = 20.0
"""Hz, against skin and cables that move (De Luca et al. 2010, doi:10.1016/j.jbiomech.2010.01.027)."""
_LOW_PASS = 6.0
"""Hz of the envelope (Winter 2009, Biomechanics and Motor Control of Human Movement, ISBN 978-0-470-39818-0)."""
_RECTIFIED = 0.02
"""Share of its largest value within which the lowest one of a channel lies that was rectified already: raw EMG goes as
far below zero as above, and beside an offset of the amplifier nothing comes near zero.
"""
_SILENT = 0.02
"""Share of the file's strongest envelope under which nothing is connected: in 30 recordings of four laboratories empty
channels have 0.1 to 1.7 %, muscles 2.2 % and more.
"""


@dataclass(frozen=True, eq=False)
class EmgEnvelope:
    """The linear envelope ``value`` (S,) of a ``muscle`` of a ``side`` at ``time`` (S,) s from the file's first frame,
    in ``unit`` at the electrodes or behind the amplifier, whichever the file holds.
    """

    muscle: str
    side: str
    unit: str
    time: Array
    value: Array


def emg_envelopes(analog: Array, rate: float, labels: Sequence[str], units: Sequence[str]) -> tuple[EmgEnvelope, ...]:
    """Return the envelopes of the ``analog`` channels (S, C) whose labels name a side and a muscle, sampled with a
    ``rate`` Hz; the first of those that name the same. Channels that read one value, or nearly nothing (`_SILENT`),
    have none.

    High-passed, rectified, low-passed, each a second-order Butterworth run forth and back.
    """
    from scipy.signal import butter, sosfiltfilt

    found: dict[tuple[str, str], EmgEnvelope] = {}
    if not rate >= _SLOWEST or len(analog) < rate / 2:
        return ()
    time = np.arange(len(analog)) / rate
    for column, label in enumerate(labels):
        named = muscle_of(label)
        if named is None or named in found or column >= analog.shape[1]:
            continue
        value = analog[:, column].astype(float)
        if not np.isfinite(value).all() or not np.ptp(value) > 0:
            continue
        unit = units[column].strip() if column < len(units) else ""
        factor = _MILLIVOLTS.get(unit.lower(), 1.0)
        told = "mV" if unit.lower() in _MILLIVOLTS else unit
        if abs(value.min()) > _RECTIFIED * np.abs(value).max():
            value = np.abs(sosfiltfilt(butter(2, _HIGH_PASS, "high", fs=rate, output="sos"), value - value.mean()))
        envelope = np.asarray(np.maximum(sosfiltfilt(butter(2, _LOW_PASS, fs=rate, output="sos"), value), 0.0))
        found[named] = EmgEnvelope(*named, told, time, factor * envelope)
    strongest = max((one.value.max() for one in found.values()), default=0.0)
    return tuple(one for one in found.values() if one.value.max() > _SILENT * strongest)


def muscle_of(label: str) -> tuple[str, str] | None:
    """Return muscle and side that the label of a channel names (``Voltage.L Tib Ant``, ``RTA``,
    ``R_tibialis_anterior``); None for all other channels.
    """
    name = re.sub(r"(?i)emg", " ", label.rpartition(".")[2] or label).strip(" _-:")
    for pattern in (r"(?P<side>left|right|l|r)[\W_]*(?P<rest>.+)", r"(?P<rest>.+?)[\W_]+(?P<side>left|right|l|r)"):
        match = re.fullmatch(pattern, name, re.IGNORECASE)
        muscle = _KNOWN.get(re.sub(r"[\W_]", "", match["rest"]).lower()) if match else None
        if match and muscle:
            return muscle, "left" if match["side"].lower().startswith("l") else "right"
    return None
