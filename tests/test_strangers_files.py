"""Files of strangers: nothing in them runs, fills the memory, is believed beyond its range, or is dropped unsaid."""

import io
import json
import os
import subprocess
import sys
import urllib.request
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from biodance.body.body import body_text, read_body
from biodance.cli.shared import say
from biodance.dance.dance import Dance
from biodance.errors import BiodanceError, FileRefused, without_codes
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.plain_text import for_spreadsheet
from biodance.lab.plates.faults import read_corrections
from biodance.lab.robot import read_encoders
from biodance.lab.session.file import read_session_file
from biodance.lab.session.results_folder import read_manifest
from biodance.library import read_toml
from biodance.pipeline.lab_file import read_lab
from biodance.report.files import write_tables
from biodance.report.live import LivePage
from biodance.report.pages.template import script_json
from biodance.report.terminal import SafeConsole


def test_no_cell_of_a_table_is_a_formula(tmp_path: Path) -> None:
    table = pd.DataFrame({"marker": ["=cmd|'/C calc'!A0", "+1", "-2", "@SUM(A1)", "\tx", "LASI"], "=x": [-1.5] * 6})
    write_tables({"markers": table}, tmp_path)
    lines = (tmp_path / "markers.csv").read_text().splitlines()
    assert lines[0] == '"marker","\'=x"'
    assert all(line.lstrip('"')[0] in "'L" for line in lines[1:])
    assert all(line.endswith("-1.5") for line in lines[1:]), "numbers stay numbers"
    assert pd.read_parquet(tmp_path / "markers.parquet")["marker"][0].startswith("=cmd"), "types need no such care"
    assert for_spreadsheet(-2.0) == -2.0


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "[" + "a." * 10_000 + "b]",
        "a = {b = " * 5_000,
        "a." * 90_000 + "b = 1",
        "'a' . \"b\" . " * 9_000 + "b = 1",
    ],
)
def test_deep_toml_is_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "lab.toml").write_text(text)
    with pytest.raises(FileRefused, match=r"lab\.toml: .*(too deeply|not valid TOML)"):
        read_toml(tmp_path / "lab.toml")


def test_deep_json_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("[" * 200_000)
    with pytest.raises(FileRefused, match="damaged"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("digits", ["9" * 400, "-" + "9" * 400])
def test_a_number_that_no_computation_takes_is_one_sentence(tmp_path: Path, digits: str) -> None:
    from small_dances import BODY

    (tmp_path / "body.json").write_text(body_text(BODY, "").replace("1", digits, 1))
    with pytest.raises(FileRefused, match="larger than anything that is counted"):
        read_body(tmp_path / "body.json")


@pytest.mark.parametrize("text", ["height_m = {}", "girths_cm = {{ thigh = [{}, 1] }}", "age = -{}"])
@pytest.mark.parametrize("digits", ["9" * 41, "9" * 400, "9" * 5000])
def test_a_whole_number_of_toml_that_no_computation_takes_is_one_sentence(
    tmp_path: Path, text: str, digits: str
) -> None:
    (tmp_path / "session.toml").write_text("[subject]\n" + text.format(digits) + "\n")
    with pytest.raises(FileRefused, match=r"session\.toml: holds a whole number of more than 40 digits"):
        read_session_file(tmp_path)


@pytest.mark.parametrize("name", ["x" * 5000, "a\\u0000b"])
@pytest.mark.parametrize(
    "text", ['[subject]\nscan = "{}"', '[subject]\nfoot_outline = "{}.csv"', '[markers]\nfile = "{}.toml"']
)
def test_a_name_that_no_file_can_have_is_one_sentence(tmp_path: Path, text: str, name: str) -> None:
    (tmp_path / "session.toml").write_text(text.format(name) + "\n")
    with pytest.raises(BiodanceError, match=r"there is no (file|such)|no file has such a name"):
        read_marker_set(read_session_file(tmp_path).marker_set)


def test_a_quotation_mark_that_is_never_closed_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "encoders.csv").write_text('time,hip\n0.00,0.1\n0.01,"0.2\n0.02,0.3\n0.03,0.4\n')
    with pytest.raises(FileRefused, match=r"encoders\.csv: a quotation mark is opened and never closed"):
        read_encoders(tmp_path / "encoders.csv")


def test_samples_that_an_encoder_lacks_are_said(tmp_path: Path) -> None:
    time = np.delete(np.arange(100) / 100, [40, 41, 70])
    rows = [f"{t:.2f},{np.sin(t):.6f}" for t in time]
    (tmp_path / "a.csv").write_text("\n".join(["time,left_knee (rad)", *rows]) + "\n")
    found = read_encoders(tmp_path / "a.csv").notes
    assert found == ("Samples are missing after 0.390 s and at 1 other place: up to 0.03 s without one.",)
    (tmp_path / "a.csv").write_text("\n".join(["time,left_knee (rad)", *rows[:40]]) + "\n")
    assert read_encoders(tmp_path / "a.csv").notes == ()


def test_a_covariance_that_is_none_is_refused(tmp_path: Path) -> None:
    from small_dances import BODY as body

    wrong = body.sip.covariance.copy()
    wrong[0, 1] += 0.1
    (tmp_path / "body.json").write_text(body_text(replace(body, sip=replace(body.sip, covariance=wrong)), ""))
    with pytest.raises(FileRefused, match="stands there twice, and differs"):
        read_body(tmp_path / "body.json")


def test_a_huge_toml_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "lab.toml").open("wb") as stream:
        stream.truncate(2**27)
    with pytest.raises(FileRefused, match="holds 134 MB, legal are up to 67"):
        read_toml(tmp_path / "lab.toml")


@pytest.fixture(scope="module")
def dance_parts(tmp_path_factory) -> dict[str, np.ndarray]:
    from small_dances import small_dance

    path = tmp_path_factory.mktemp("dance") / "dance.npz"
    small_dance().save(path)
    with np.load(path) as found:
        return {name: found[name] for name in found.files}


def changed(parts: dict[str, np.ndarray], **words: object) -> dict[str, np.ndarray]:
    return {**parts, "words": np.array(json.dumps({**json.loads(str(parts["words"])), **words}))}


def test_a_dance_as_written_is_read(dance_parts, tmp_path: Path) -> None:
    np.savez(tmp_path / "dance.npz", **dance_parts)
    assert len(Dance.load(tmp_path).postures) == 2


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda p: {**p, "postures": np.full_like(p["postures"], np.nan)}, "postures: nan is no number"),
        (lambda p: {**p, "hold": -p["hold"] - 1}, "hold: .* legal are 0 to 3600 s"),
        (lambda p: {**p, "hold": p["hold"] + 1e9}, "hold: .* legal are 0 to 3600 s"),
        (lambda p: {**p, "move": p["move"].astype("U9")}, "legal are up to 1000 rows of float64"),
        (lambda p: {**p, "postures": np.zeros((5000, 3))}, "legal are up to 1000 rows"),
        (lambda p: changed(p, subject={"mass": 1e30, "stature": 1.7, "sex": "F"}), "subject.mass"),
        (lambda p: changed(p, plate=[-1.0, 0.5]), "plate"),
        (lambda p: changed(p, seed="x"), "seed"),
        (lambda p: changed(p, stances=[]), "stances"),
        (lambda p: {**p, "words": np.array("[" * 100_000)}, "too deeply"),
    ],
)
def test_a_dance_beyond_its_ranges_is_refused(dance_parts, tmp_path: Path, change, why: str) -> None:
    np.savez(tmp_path / "dance.npz", **change(dance_parts))
    with pytest.raises(FileRefused, match=f"is not a dance that biodance wrote .*{why}"):
        Dance.load(tmp_path)


def test_a_dance_that_unpacks_to_gigabytes_is_not_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "dance.npz", "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("words.npy", b"\0" * 2**27)
    assert (tmp_path / "dance.npz").stat().st_size < 2**20
    with pytest.raises(FileRefused, match="holds 134 MB, legal are up to 67"):
        Dance.load(tmp_path)


def test_an_array_that_claims_gigabytes_is_refused(dance_parts, tmp_path: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**40, 3)})
    np.savez(tmp_path / "dance.npz", **{k: v for k, v in dance_parts.items() if k != "postures"})
    with zipfile.ZipFile(tmp_path / "dance.npz", "a") as packed:
        packed.writestr("postures.npy", header.getvalue() + b"\0" * 64)
    with pytest.raises(FileRefused, match="is not a dance that biodance wrote"):
        Dance.load(tmp_path)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ('[corrections.plate_gain."plate1:Fz"]\ngain = 50', r"gain = 50; expected a number in 1, -0\.5 to 1"),
        ('[corrections.plate_gain."plate1:Fz"]\ngain = nan', "gain = nan; expected"),
        ('[corrections.plate_gain."plate1:Fz"]\ngain = 0.1\nsd = []', r"sd = \[\]; expected a number"),
        ('[corrections.plate_gain."plate1:Fz"]\ngain = 0.1\nsd = -1', "sd = -1; expected a number"),
        ('[corrections.plate_position."plate1:x"]\nshift = 1e6', "expected a number in m, -10 to 10"),
        ("[corrections.time_delay]\ndelay = inf", "expected a number in s, -10 to 10"),
    ],
)
def test_a_correction_that_no_plate_needs_is_refused(tmp_path: Path, line: str, why: str) -> None:
    (tmp_path / "lab.toml").write_text(line)
    with pytest.raises(FileRefused, match=why):
        read_corrections(tmp_path / "lab.toml")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[norms.x]\nvalue = nan\nsd = 1", r"norms\.x\.value = nan"),
        ("[norms.x]\nvalue = 0\nsd = []", r"norms\.x\.sd = \[\]"),
        ("[norms.x]\nvalue = 0\nsd = -1.0", r"norms\.x\.sd = -1\.0"),
        ("[corection]", r"\[corection\] is nothing"),
        ('[tolerances]\norigin = "x"\nthreshold = 1\nnoise = [[1]]\nmovement = []', "noise"),
        (
            '[tolerances]\norigin = "x"\nthreshold = 1\nnoise = []\nmovement = []\nsizes = {"plate_gian Fz" = 0.1}',
            "'plate_gian Fz' is the size of nothing",
        ),
        ('[normal."gait knee_flexion"]\nunit = "deg"\npeople = 0\nmean = [1, 2]\nsd = [1, 2]', "people = 0"),
    ],
)
def test_a_lab_file_beyond_its_ranges_is_refused(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "lab.toml").write_text(text)
    with pytest.raises(FileRefused, match=why):
        read_lab(tmp_path / "lab.toml")


def test_no_text_leaves_the_script_that_holds_it() -> None:
    told = {"name": "<!--<script>", "end": "</script><img src=x onerror=alert(1)>"}
    text = script_json(told)
    assert "<" not in text
    assert json.loads(text) == told


def test_no_name_commands_the_terminal(capsys) -> None:
    name = "LASI\x1b]0;owned\x07\x1b[31m\u202egnp"
    assert without_codes(name) == "LASI\\x1b]0;owned\\x07\\x1b[31m\\u202egnp"
    say(f"{name}: is empty.")
    stream = io.StringIO()
    SafeConsole(file=stream, force_terminal=True, width=200).print(f"marker {name}")
    for shown in (capsys.readouterr().err, stream.getvalue()):
        assert "\x1b]0" not in shown
        assert "\u202e" not in shown
        assert "LASI\\x1b" in shown


COMMAND = [sys.executable, "-m", "biodance", "settings"]


def test_an_output_that_was_closed_is_one_sentence(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    found = subprocess.run(COMMAND, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=120, check=False)
    os.close(writer)
    assert found.returncode == 2
    assert found.stderr == "The output was closed before all was written to it. What went into files is complete.\n"


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_without_streams_a_command_runs(closed: str) -> None:
    line = f"{sys.executable} -m biodance settings {closed}"
    found = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=120, check=False)
    assert found.returncode == 0
    assert not found.stderr


def test_a_closed_tab_leaves_no_traceback(capfd) -> None:
    import socket

    with LivePage() as page:
        port = int(page.address.rsplit(":", 1)[1].strip("/"))
        for _ in range(5):
            tab = socket.create_connection(("127.0.0.1", port))
            tab.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # closed by a reset
            tab.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1:1\r\n\r\n")
            tab.close()
        assert urllib.request.urlopen(page.address, timeout=10).status == 200
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("mass", [float("inf"), float("-inf"), 1e30])
def test_a_mass_that_nobody_has_is_said(tmp_path: Path, mass: float) -> None:
    from lab_sessions import person

    from biodance.lab.c3d.write import write_c3d
    from biodance.lab.readers.c3d import read_c3d

    said = {"PROCESSING": {"Bodymass": mass, "Height": 1750.0}}
    write_c3d(tmp_path / "walk.c3d", markers=person(frames=10), plates=[], analog_rate=1000.0, parameters=said)
    trial = read_c3d(tmp_path / "walk.c3d")
    assert "Bodymass" not in trial.measurements
    assert any("Bodymass" in line and "left out" in line for line in trial.warnings)
