"""The commented ``[plates.NAME]`` tables that `biodance init` writes: what the files say of each plate, to be
corrected, and plates that only their channels show, to be described.
"""

import json
from collections.abc import Iterator, Sequence

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d, read_raw
from biodance.lab.c3d.read import file_frame
from biodance.lab.plates.parameters import channel_groups, plate_parameters
from biodance.records import Plate, Session, Trial

_ORDER = "# m, lab frame, z up; +x+y, -x+y, -x-y, +x-y of the plate's own axes"


def plate_lines(session: Session) -> Iterator[str]:
    """Yield the tables of all plates of a session, every line with a # before it."""
    plates: dict[str, tuple[Plate, Trial]] = {}
    for trial in session.trials:
        for plate in trial.plates:
            plates.setdefault(plate.name, (plate, trial))
    hidden = None if plates else _undescribed(session)
    if not plates and hidden is None:
        return
    yield "# Force plates: what stands here comes before what the files say. Take the # from the table's name and from"
    yield "# what you correct."
    for plate, trial in plates.values():
        yield f"# [plates.{plate.name}] # as in {trial.name}"
        corners = [[round(float(x), 5) for x in corner] for corner in plate.corners]
        yield f"# corners_m = {json.dumps(corners)} {_ORDER}"
        if plate.type:
            yield f"# type = {plate.type} # of the C3D standard"
            yield from _channel_lines(*_channels(plate, trial))
        yield from _use_lines()
    if hidden is None:
        return
    raw, groups = hidden
    for number, columns in enumerate(groups, start=1):
        yield f"# [plates.plate{number}] # its channels are in {raw.path.name}, which does not describe it"
        yield f"# corners_m = [[x, y, z], [x, y, z], [x, y, z], [x, y, z]] {_ORDER}"
        yield f"# type = {2 if len(columns) == 6 else 3} # of the C3D standard"
        yield from _channel_lines([raw.analog_labels[column] for column in columns], (1.0,) * len(columns))
        yield from _use_lines()


def _undescribed(session: Session) -> tuple[RawC3d, tuple[tuple[int, ...], ...]] | None:
    """Return the first file with channels that look like plates, and their columns."""
    for trial in session.trials:
        if trial.source.format == "C3D":
            raw = read_raw(trial.source.path)
            if groups := channel_groups(raw.analog_labels):
                return raw, groups
    return None


def _channels(plate: Plate, trial: Trial) -> tuple[list[str | int], tuple[float, ...]]:
    """Return the labels of a plate's channels, or their numbers where labels do not tell them apart, and N or N·m per
    unit of each; no sensitivity where the file has a matrix, nothing where it describes no such plate.
    """
    if trial.source.format != "C3D":
        return [], ()
    raw = read_raw(trial.source.path)
    try:
        found = plate_parameters(raw, int(plate.name.removeprefix("plate")), metres=file_frame(raw)[0])
    except TrialRefused:
        return [], ()
    labels = [raw.analog_labels[column] for column in found.channels]
    told = all(label and raw.analog_labels.count(label) == 1 for label in labels)
    factors = () if found.calibration is not None else found.factors
    return [*labels] if told else [column + 1 for column in found.channels], factors


def _channel_lines(channels: Sequence[str | int], factors: tuple[float, ...]) -> Iterator[str]:
    if channels:
        yield f"# channels = {json.dumps(channels, ensure_ascii=False)} # labels, or numbers from 1"
    if factors:
        yield f"# sensitivity = {[*factors]} # N, N·m per unit of each channel as in the file; or rows of a matrix"


def _use_lines() -> Iterator[str]:
    yield '# foot = "left" # or "right", where the markers do not tell which foot stands on it'
    yield "# use = false # leaves the plate out"
    yield ""
