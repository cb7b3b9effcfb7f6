"""The subject in a C3D file: which points are markers on the person - no model output, not unlabelled, not another
person's - the measures (groups PROCESSING, SUBJECTS and SUBJECT), in m and kg, that recording software wrote; and what
other programs left in the file: angles, events, and the muscles' activity as linear envelopes.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d import Parameters
from biodance.lab.c3d.layout import Layout, parameter_numbers, texts
from biodance.lab.c3d.raw import RawC3d, open_c3d, point_labels, read_numbers, segment_poses, split_label, unlabelled
from biodance.records import Array, FootEvent, grouped

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
_MILLIVOLTS = {"v": 1e3, "mv": 1.0, "uv": 1e-3, "µv": 1e-3, "μv": 1e-3}
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

    High-passed at 20 Hz, against skin and cables that move (De Luca et al. 2010, doi:10.1016/j.jbiomech.2010.01.027),
    rectified, low-passed at 6 Hz (Winter 2009, Biomechanics and Motor Control of Human Movement, ISBN
    978-0-470-39818-0), each a second-order Butterworth run forth and back.
    """
    from scipy.signal import butter, sosfiltfilt

    found: dict[tuple[str, str], EmgEnvelope] = {}
    # What is sampled slower holds no raw EMG, whose power lies up to 250 Hz and more (Hermens et al. 2000).
    if not rate >= 500.0 or len(analog) < rate / 2:
        return ()
    time = np.arange(len(analog)) / rate
    high, low = butter(2, 20.0, "high", fs=rate, output="sos"), butter(2, 6.0, fs=rate, output="sos")
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
        # What goes below zero is not rectified yet: raw EMG goes as far below zero as above, and beside an offset of
        # the amplifier nothing comes near zero.
        if abs(value.min()) > 0.02 * np.abs(value).max():
            value = np.abs(sosfiltfilt(high, value - value.mean()))
        envelope = np.asarray(np.maximum(sosfiltfilt(low, value), 0.0))
        found[named] = EmgEnvelope(*named, told, time, factor * envelope)
    strongest = max((one.value.max() for one in found.values()), default=0.0)
    return tuple(one for one in found.values() if one.value.max() > _SILENT * strongest)


def muscle_of(label: str) -> tuple[str, str] | None:
    """Return muscle and side that the label of a channel names (``Voltage.L Tib Ant``, ``RTA``,
    ``R_tibialis_anterior``); None for all other channels.
    """
    name = re.sub(r"(?i)emg", " ", label.rpartition(".")[2] or label).strip(" _-:")
    known = {short: muscle for muscle, names in _MUSCLES.items() for short in names.split()}
    for pattern in (r"(?P<side>left|right|l|r)[\W_]*(?P<rest>.+)", r"(?P<rest>.+?)[\W_]+(?P<side>left|right|l|r)"):
        match = re.fullmatch(pattern, name, re.IGNORECASE)
        muscle = known.get(re.sub(r"[\W_]", "", match["rest"]).lower()) if match else None
        if match and muscle:
            return muscle, "left" if match["side"].lower().startswith("l") else "right"
    return None


@dataclass(frozen=True, eq=False)
class FileOutputs:
    """``angles`` by label, (T, 3) deg, NaN = none; foot ``events`` by time from the first frame; what the muscles did
    (``emg``).
    """

    angles: Mapping[str, Array]
    events: tuple[FootEvent, ...]
    emg: tuple[EmgEnvelope, ...] = ()


NO_OUTPUTS = FileOutputs({}, ())
"""Of a file that holds nothing of other programs."""


def read_outputs(path: str | Path) -> FileOutputs:
    """Return the joint angles, foot events and muscle activity of a C3D file; empty where it holds none.

    Raises
    ------
    FileRefused
        The file cannot be read.
    """
    content, parameters, layout, _ = open_c3d(Path(path))
    listed = {split_label(label)[1] for label in texts(parameters, "POINT", "ANGLES")}
    unit = next(iter(texts(parameters, "POINT", "ANGLE_UNITS")), "deg")
    degrees = 180 / np.pi if unit.lower().startswith("rad") else 1.0
    names = [split_label(label)[1] for label in point_labels(parameters, layout)]
    columns = {name: column for column, name in enumerate(names) if name in listed or name.endswith("Angles")}
    channels = texts(parameters, "ANALOG", "LABELS")[: layout.channels]
    angles, emg = {}, tuple[EmgEnvelope, ...]()
    if columns or any(map(muscle_of, channels)):
        points, analog = read_numbers(content, layout)
        emg = emg_envelopes(analog, layout.analog_rate, channels, texts(parameters, "ANALOG", "UNITS"))
        for name, column in columns.items():
            value = degrees * points[:, column]
            angles[name] = np.where((value != 0).any(axis=1)[:, None], value, np.nan)
    return FileOutputs(angles, _events(parameters, layout), emg)


def _events(parameters: Parameters, layout: Layout) -> tuple[FootEvent, ...]:
    times = np.asarray(parameters.get("EVENT", {}).get("TIMES", np.empty((2, 0))), dtype=float)
    times = times.reshape(2, -1, order="F") if times.ndim == 1 else times
    # Times of events count from frame 1 of the camera, ours from the first frame of the file.
    first = (layout.first_frame - 1) / layout.rate
    found = []
    words = zip(times.T, texts(parameters, "EVENT", "CONTEXTS"), texts(parameters, "EVENT", "LABELS"), strict=False)
    sides = {"left": "left", "right": "right", "l": "left", "r": "right"}
    kinds = {"foot strike": True, "foot off": False, "toe off": False, "heel strike": True}
    for (minutes, seconds), context, label in words:
        side, down = sides.get(context.strip().lower()), kinds.get(label.strip().lower())
        if side is not None and down is not None:
            found.append(FootEvent(float(60 * minutes + seconds - first), side, down, "file"))
    return tuple(sorted(found, key=lambda one: one.time))


@dataclass(frozen=True)
class MarkerLabels:
    """The chosen points: ``columns`` in the file, ``names``, ``history`` of decisions, ``warnings``."""

    columns: tuple[int, ...]
    names: tuple[str, ...]
    history: tuple[str, ...]
    warnings: tuple[str, ...]


def subjects_in(path: Path) -> tuple[str, ...]:
    """Return the names of the subjects in a C3D file, of which no point is read; FileRefused as of `read_raw`."""
    _, parameters, layout, _ = open_c3d(path)
    return subjects_of(point_labels(parameters, layout), parameters)


def subjects_of(labels: Sequence[str], parameters: Parameters) -> tuple[str, ...]:
    """Return the names of the subjects in a file: prefixes of its labels (`people_of`), else SUBJECTS:NAMES."""
    nameless = unlabelled(labels)
    prefixes = [split_label(label)[0] for i, label in enumerate(labels) if i not in nameless]
    return people_of(prefixes) if any(prefixes) else tuple(filter(None, texts(parameters, "SUBJECTS", "NAMES")))


def people_of(prefixes: Iterable[str]) -> tuple[str, ...]:
    """Return those of the prefixes, one for each marker, that name people; all where nobody carries many."""
    counts = Counter(prefixes)
    # A thing (a club, a wheel, a probe) has six markers at most, three on each of two rigid parts; fewer than seven
    # show no pelvis with two legs.
    enough = {prefix for prefix, count in counts.items() if count > 6}
    return tuple(prefix for prefix in counts if prefix and (prefix in enough or not enough))


def poses_only(raw: RawC3d) -> str:
    """Return the sentence for a file with segment poses (group ROTATION) and no point ever seen; "" for others."""
    said = "" if np.isfinite(raw.points).any() else segment_poses(raw.parameters)
    return f"{raw.path}: {said}" if said else ""


def marker_labels(raw: RawC3d, *, subject: str | None) -> MarkerLabels:
    """Return the points that are markers of ``subject`` (None = the only one).

    Raises
    ------
    FileRefused
        Labels of several subjects and none chosen, or the chosen one is not among them; the message lists the subjects.
    """
    history: list[str] = []
    warnings: list[str] = []
    outputs = set(raw.outputs)
    columns = [i for i in range(len(raw.labels)) if i not in outputs]
    if outputs:
        shown = ", ".join(raw.labels[i] for i in raw.outputs[:3])
        history.append(
            f"{len(outputs)} points are results of a model in the recording software, not markers: {shown} ..."
        )
    nameless = raw.nameless.intersection(columns)
    if nameless:
        history.append(f"{len(nameless)} unlabelled points are left out.")
    columns = _of_subject(raw, [i for i in columns if i not in nameless], subject, history)
    columns, names = _without_repeats(raw, columns, history, warnings)
    return MarkerLabels(tuple(columns), tuple(names), tuple(history), tuple(warnings))


def _of_subject(raw: RawC3d, columns: list[int], subject: str | None, history: list[str]) -> list[int]:
    """Return the columns whose label belongs to the chosen subject."""
    prefixes = people_of(raw.split_labels[i][0] for i in columns)
    things = dict.fromkeys(prefix for i in columns if (prefix := raw.split_labels[i][0]) not in ("", *prefixes))
    of_people = [i for i in columns if raw.split_labels[i][0] not in things]
    if things:
        history.append(
            f"{len(columns) - len(of_people)} points of {', '.join(things)} left out: so few markers are those of a "
            f"thing."
        )
    columns = of_people
    if subject is None and len(prefixes) > 1:
        raise FileRefused(
            f"{raw.path}: holds markers of {len(prefixes)} subjects ({', '.join(prefixes)}) and none was chosen. "
            "Name one of them as the subject."
        )
    known = subjects_of(raw.labels, raw.parameters)
    chosen = subject if subject is not None else (prefixes[0] if prefixes else None)
    if chosen is None:
        return columns
    match = next((name for name in known if name.casefold() == chosen.casefold()), None)
    if match is None and known:
        raise FileRefused(
            f"{raw.path}: has no subject {chosen!r}. Its subjects are {', '.join(known)}. Name one of them."
        )
    if not prefixes:
        return columns
    own = [i for i in columns if raw.split_labels[i][0] in ("" if len(prefixes) == 1 else match, match)]
    history.append(
        f"Markers of subject {match!r} taken, the prefix removed; {len(columns) - len(own)} points of others left out."
    )
    return own


def _without_repeats(
    raw: RawC3d, columns: list[int], history: list[str], warnings: list[str]
) -> tuple[list[int], list[str]]:
    """Return columns and names: an unseen or equal repetition goes, a different one is numbered like the first."""
    places = grouped((raw.split_labels[column][1], column) for column in columns)
    kept: dict[int, str] = {}
    for name, same in places.items():
        if len(same) == 1:
            kept[same[0]] = name
            continue
        different: list[int] = []
        for column in sorted(same, key=lambda c: -int(np.isfinite(raw.points[:, c, 0]).sum())):
            unseen = not np.isfinite(raw.points[:, column]).any()
            if not different or not (
                unseen or np.array_equal(raw.points[:, column], raw.points[:, different[0]], equal_nan=True)
            ):
                different.append(column)
        if len(same) > len(different):
            history.append(f"Label {name} occurs {len(same)} times; repetitions that are empty or equal are left out.")
        if len(different) > 1:
            warnings.append(
                f"Label {name} is given to {len(different)} different points, so neither is taken for {name}: they are "
                f"called {name}#1, {name}#2 ... Correct the labels in the recording software."
            )
        kept |= {
            column: name if len(different) == 1 else f"{name}#{n}"
            for n, column in enumerate(sorted(different), start=1)
        }
    return sorted(kept), [kept[column] for column in sorted(kept)]


_PLAIN = {"Bodymass": (2.0, 400.0), "age": (0.0, 120.0), "gender": (0.0, 1.0)}
"""Measures that are no lengths, with the numbers that a person can have."""
_OF_A_SIDE = (
    "LegLength KneeWidth AnkleWidth ShoulderOffset ElbowWidth WristWidth HandThickness AsisTrocanterDistance "
    "FemurLength TibiaLength FootLength SoleDelta"
)
_MEASURES = ("Height", "MarkerDiameter", "InterAsisDistance", "PelvisLength", *_PLAIN)
_NAMES = {name.upper(): name for name in (*_MEASURES, *(side + name for side in "LR" for name in _OF_A_SIDE.split()))}
"""Every measure by its name in upper case."""


def measurements_of(raw: RawC3d) -> tuple[dict[str, float], tuple[str, ...], tuple[str, ...]]:
    """Return the measures by name (lengths m, Bodymass kg, age years, gender 0 woman 1 man), history and warnings.

    Lengths are stored in mm by Vicon, in m or cm by others: the one unit in which stature and leg length are those of a
    person is taken for all of them. Zeros mean "not measured" and are left out, as is everything that a person cannot
    have.
    """
    known = {_NAMES[name]: value for name, value in _written(raw).items() if name in _NAMES}
    written = {name: value for name, value in known.items() if value != 0 and not math.isnan(value)}
    # metres per unit by which stature, else a leg, is a person's; mm if neither is there
    stature, units = (0.4, 2.6), {1e-3: "mm", 1.0: "m", 1e-2: "cm"}
    lengths = {"Height": stature, "LLegLength": (0.2, 1.4), "RLegLength": (0.2, 1.4)}
    ranges = [(written[name], *legal) for name, legal in lengths.items() if name in written]
    scale = next((s for value, low, high in ranges for s in units if low <= value * s <= high), 1e-3)
    warnings: list[str] = []
    measures: dict[str, float] = {}
    for name, value in written.items():
        low, high = stature if name == "Height" else _PLAIN.get(name, (-0.1, stature[1]))
        value = value if name in _PLAIN else value * scale
        if low <= value <= high:
            measures[name] = value
        else:
            warnings.append(f"The file says {name} = {written[name]:g}, which a person cannot have; it was left out.")
    sized = f", lengths in {units[scale]}" if measures.keys() - {*_PLAIN} else ""
    said = f"{len(measures)} measures of the subject read from the file{sized}."
    return measures, (said,) if measures else (), tuple(warnings)


def as_written(measures: Mapping[str, float]) -> dict[str, float]:
    """Return measures (lengths m, as `measurements_of`) as PROCESSING holds them: lengths in mm, the rest unchanged."""
    return {name: value if name in _PLAIN else 1000 * value for name, value in measures.items()}


def _written(raw: RawC3d) -> dict[str, float]:
    """Return all single numbers of the groups by upper-case name, as written."""
    found: dict[str, float] = {}
    other = {"WEIGHT": "BODYMASS", "MASS": "BODYMASS", "STATURE": "HEIGHT", "SEX": "GENDER"}
    for group in ("PROCESSING", "SUBJECTS", "SUBJECT"):
        listed = zip(
            texts(raw.parameters, group, "LABELS"), parameter_numbers(raw.parameters, group, "VALUES"), strict=False
        )
        direct = ((name, parameter_numbers(raw.parameters, group, name)) for name in raw.parameters.get(group, {}))
        pairs = [*listed, *((name, values[0]) for name, values in direct if values.size == 1)]
        for name, value in pairs:
            key = name.upper().replace("_", "").replace(" ", "").lstrip("$")
            found.setdefault(other.get(key, key), float(value))
    return found
