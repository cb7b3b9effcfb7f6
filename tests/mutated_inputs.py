"""Sound files of every kind that biodance reads, and what a mutation does to them and to the reader."""

import json
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lab_sessions import person, plate, table_of
from robots import biped
from small_dances import BODY, small_dance
from trimesh.creation import box

from biodance.body.body import body_text, read_body
from biodance.body.solids import read_mesh
from biodance.body.tables.anthropometry import read_segment_table
from biodance.body.urdf import read_urdf
from biodance.dance.dance import Dance
from biodance.dance.problem.plan import read_plan
from biodance.errors import BiodanceError
from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.program_tables import read_mot, write_mot
from biodance.lab.readers.amti_text import read as read_amti_ascii
from biodance.lab.readers.bsf import read as read_bsf
from biodance.lab.readers.c3d import read_c3d
from biodance.lab.readers.trc import read_trc, write_trc
from biodance.lab.robot import read_encoders
from biodance.lab.session.file import read_session_file, traced_outline
from biodance.lab.session.results_folder import check_results, write_manifest
from biodance.library import folder
from biodance.pipeline.lab_file import read_lab
from biodance.records import SIDES, Trial
from biodance.report.laboratory import to_toml
from biodance.uncertainty.tolerances import shipped

PATIENCE = 20
"""s after which a reader hangs."""


@dataclass(frozen=True)
class Input:
    """A kind of file: its ``name`` on the disk, how it is ``written`` soundly, and what is ``read`` of it: numbers by
    name, and the sentences that are said.
    """

    name: str
    written: Callable[[Path], None]
    read: Callable[[Path], tuple[dict[str, np.ndarray], tuple[str, ...]]]
    text: bool = True


def _trial(trial: Trial) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    numbers = {f"wrench {one.name}": one.wrench.value for one in trial.plates}
    numbers |= {f"corners {one.name}": one.corners for one in trial.plates}
    if trial.markers is not None:
        numbers |= {"time": trial.markers.time} | {name: trial.markers[name] for name in trial.markers.names}
    return numbers, (*trial.warnings, *trial.history)


def _c3d(path: Path) -> None:
    one = plate(frames=400)
    recording = PlateRecording(2, one.corners, [0, 0, -0.04], one.wrench.value)
    write_c3d(path, markers=person(frames=40), plates=[recording], analog_rate=1000.0)


def _columns(path: Path, header: str, rows: np.ndarray) -> None:
    path.write_text(header + "\n".join(",".join(f"{v:.6g}" for v in row) for row in rows) + "\n")


def _time(count: int) -> np.ndarray:
    return np.arange(count)[:, None] / 100


def _amti(path: Path) -> None:
    _columns(path, "", np.hstack([_time(200), plate(frames=200).wrench.value]))
    said = ['columns = ["time_s", "Fx", "Fy", "Fz", "Mx", "My", "Mz"]', 'force_unit = "N"', 'moment_unit = "Nm"']
    path.with_suffix(".toml").write_text("\n".join([*said, "rate_hz = 100", "plate_size_m = [0.464, 0.508]"]) + "\n")


def _encoders(path: Path) -> None:
    angles = 0.2 * np.sin(_time(100) + np.arange(3))
    _columns(path, "time,left_hip (rad),left_knee (rad),left_ankle (rad)\n", np.hstack([_time(100), angles]))


def _table(found: Any) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    numbers = {"time": found.time} | {name: found[name] for name in found.columns}
    return numbers, (*found.history, *found.warnings)


def _joints(found: Any) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    return {"time": found.time} | dict(zip(found.joints, found.angle.T, strict=True)), found.notes


def _session(path: Path) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    one = read_session_file(path.parent)
    raw = json.loads(json.dumps(asdict(one), default=str))
    return {"all": np.array(json.dumps(raw, sort_keys=True))}, ()


def _lab(path: Path) -> None:
    path.write_text(
        '[corrections.plate_gain."plate1:Fz"]\ngain = 0.04\nsd = 0.002\nsource = "session S1"\n\n'
        "[norms.stride]\nvalue = 1.0\nsd = 0.1\n\n" + to_toml(shipped(), under="tolerances")
    )


def _said(path: Path) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    lab = read_lab(path)
    tolerances = lab.tolerances
    numbers = {f"correction {k}": np.array([one.value, one.sd]) for k, one in enumerate(lab.corrections)}
    if tolerances is not None:
        numbers |= {"noise": tolerances.noise, "movement": tolerances.movement}
        numbers |= {f"size {key}": np.array(value) for key, value in tolerances.sizes.items()}
    return numbers, ()


def _body(body: Any) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    return {"phi": body.sip.phi, "covariance": body.sip.covariance, "markers": body.markers.position}, ()


def _results(path: Path) -> None:
    path.write_text(json.dumps({"trials": [{"name": "walk", "marker_rms_m": 0.012}], "subject": {"mass_kg": 62.0}}))
    write_manifest(path.parent, path.parent, {})


def _feet(path: Path) -> None:
    angle = np.linspace(0, 6.2, 20)
    rows = [
        f"{side},{x:.3f},{y:.3f}" for side in SIDES for x, y in zip(13 * np.cos(angle), 4 * np.sin(angle), strict=True)
    ]
    path.write_text("\n".join(["side,x_cm,y_cm", *rows]) + "\n")


def _shown(found: object) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    return {"all": np.array(repr(found))}, ()


def _verified(path: Path) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    found = check_results(path.parent)
    assert found is not None
    return {"bytes": np.array(path.read_bytes())}, found.changed


def _shipped(*parts: str) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(folder(parts[0]).joinpath(*parts[1:]).read_bytes()) and None


INPUTS = {
    "c3d": Input("walk.c3d", _c3d, lambda path: _trial(read_c3d(path)), text=False),
    "trc": Input("walk.trc", lambda path: write_trc(path, person(frames=40)) and None, lambda p: _trial(read_trc(p))),
    "mot": Input(
        "walk.mot", lambda path: write_mot(path, table_of((plate(frames=200),))) and None, lambda p: _table(read_mot(p))
    ),
    "amti": Input(
        "stand.csv",
        _amti,
        lambda path: _trial(read_amti_ascii(path)),
    ),
    "encoders": Input("encoders.csv", _encoders, lambda path: _joints(read_encoders(path))),
    "session": Input(
        "session.toml",
        lambda path: (
            path.write_text(
                '[subject]\nmass_kg = 62.0\nheight_m = 1.70\nsex = "F"\nage = 31\n\n[trials.walk]\nrole = "fit"\n\n'
                '[settings]\n"filter.cutoff" = 6.0\n'
            )
            and None
        ),
        _session,
    ),
    "lab": Input("lab.toml", _lab, _said),
    "body": Input(
        "body.json",
        lambda path: path.write_text(body_text(BODY, "made")) and None,
        lambda path: _body(read_body(path)[0]),
    ),
    "dance": Input(
        "dance.npz",
        lambda path: small_dance().save(path),
        lambda path: ({"x": (one := Dance.load(path)).postures, "hold": one.hold, "move": one.move}, ()),
        text=False,
    ),
    "results": Input("results.json", _results, _verified),
    "urdf": Input(
        "robot.urdf",
        lambda path: path.write_text(biped()) and None,
        lambda path: _body(read_urdf(path, feet=("r_sole", "l_sole"))),
    ),
    "feet": Input("feet.csv", _feet, lambda path: _shown(traced_outline(path))),
    "scan": Input(
        "scan.obj",
        lambda path: box(extents=(0.4, 0.3, 1.7)).export(path) and None,
        lambda path: ({"corners": np.asarray(read_mesh(path).vertices)}, ()),
    ),
    "marker set": Input(
        "set.toml",
        _shipped("anthropometry", "marker_sets", "vicon_41.toml"),
        lambda path: _shown(read_marker_set(path)),
    ),
    "segment table": Input(
        "table.csv",
        _shipped("anthropometry", "segments", "winter_2009.csv"),
        lambda path: _shown(read_segment_table(path)),
    ),
    "protocol": Input("plan.toml", _shipped("protocols", "dances", "easy.toml"), lambda path: _shown(read_plan(path))),
}
"""Every kind of input; bsf recordings come from real data (`bsf_input`)."""


def bsf_input(recorded: Path) -> Input:
    """Return the AMTI native format, with the beginning of a real recording as the sound file."""
    content = recorded.read_bytes()
    return Input("a.bsf", lambda path: path.write_bytes(content) and None, lambda p: _trial(read_bsf(p)), text=False)


_TOKENS = (b"nan", b"inf", b"-inf", b"1e400", b"-1e300", b"", b"x", b"=1+1", b"0x10", b"1,5", b"1.2.3", b"true", b"[]",
    b"9" * 400, b"\x1b[31m", b'"', b"'", b"\x00", b"{", b"--1", b"1_0", b"\xff\xfe", "\u0663".encode())  # fmt: skip


def _byte(content: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        out[int(rng.integers(len(out)))] = int(rng.integers(256))
    return bytes(out)


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content)))]


def _lost(content: bytes, rng: np.random.Generator) -> bytes:
    at, size = int(rng.integers(len(content))), int(rng.choice([1, 2, 7, 64, 512]))
    return content[:at] + content[at + size :]


def _put_in(content: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(content)))
    return content[:at] + bytes(rng.choice(_TOKENS)) + content[at:]


def _token(content: bytes, rng: np.random.Generator) -> bytes:
    """Put a token in the place of one between separators."""
    starts = [i for i, byte in enumerate(content) if byte in b" \t,=[:\n"]
    if not starts:
        return _byte(content, rng)
    at = int(rng.choice(starts)) + 1
    end = next((i for i in range(at, len(content)) if content[i] in b" \t,]}\n"), len(content))
    return content[:at] + bytes(rng.choice(_TOKENS)) + content[end:]


def _rows(content: bytes, rng: np.random.Generator) -> bytes:
    """Lose, double or exchange rows, or a piece where there are none."""
    parts = (
        content.split(b"\n") if content.count(b"\n") > 3 else [content[i : i + 64] for i in range(0, len(content), 64)]
    )
    joint = b"\n" if content.count(b"\n") > 3 else b""
    i, j = sorted(int(k) for k in rng.integers(len(parts), size=2))
    match int(rng.integers(3)):
        case 0:
            del parts[i]
        case 1:
            parts.insert(i, parts[i])
        case _:
            parts[i], parts[j] = parts[j], parts[i]
    return joint.join(parts)


def _cells(content: bytes, rng: np.random.Generator) -> bytes:
    """Lose or double a cell of one row."""
    rows = content.split(b"\n")
    row = int(rng.integers(len(rows)))
    mark = b"\t" if b"\t" in rows[row] else b","
    cells = rows[row].split(mark)
    at = int(rng.integers(len(cells)))
    rows[row] = mark.join(cells[:at] + cells[at + 1 :] if rng.integers(2) else cells[: at + 1] + cells[at:])
    return b"\n".join(rows)


def _coding(content: bytes, rng: np.random.Generator) -> bytes:
    """Another coding or other line ends, in which nothing changes its meaning."""
    text = content.decode("latin-1")
    choice = (text.encode("utf-16"), text.encode("utf-8-sig"), content.replace(b"\n", b"\r\n"), content + b"\n\n")
    return choice[int(rng.integers(len(choice)))]


def _deep(content: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(content)))
    return content[:at] + bytes(rng.choice([b"[", b"{", b'{"a":', b"a.", b"<a>"])) * 20_000 + content[at:]


MUTATIONS = {one.__name__[1:]: one for one in (_byte, _cut, _lost, _put_in, _token, _rows, _cells, _coding, _deep)}


@contextmanager
def _in_time() -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"no answer within {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def judged(kind: Input, path: Path, sound: tuple[dict[str, np.ndarray], tuple[str, ...]]) -> str:
    """Return what a reader makes of a file: "refused", "same", "other data" (with what differs), or raise."""
    with _in_time(), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found, said = kind.read(path)
        except BiodanceError as why:
            return "refused" if str(why).strip() else "refused without a word"
    for name, value in found.items():
        if value.dtype.kind == "f":
            assert not np.isinf(value).any(), f"{name} is infinite"
    before, sentences = sound
    differ = [name for name in before.keys() | found.keys() if not _equal(before.get(name), found.get(name))]
    if not differ:
        return "same"
    new = [line for line in said if line not in sentences]
    return f"other data: {', '.join(sorted(differ)[:3])}; said: {new[:2]}"


def _equal(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    if one is None or other is None or one.shape != other.shape:
        return False
    return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f"))
