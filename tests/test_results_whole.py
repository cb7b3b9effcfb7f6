"""A results folder is the earlier one or the new one, whole: nothing stale, nothing half, nothing of others lost."""

import json
import os
from pathlib import Path

import pytest

from biodance.cli import run as command
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.session import results_folder as rooms
from biodance.lab.session.results_folder import (
    check_results,
    file_hash,
    inputs_of,
    read_manifest,
    refuse_mixture,
    results_folder,
    whole_folder,
)


@pytest.fixture
def session(tmp_path: Path) -> Path:
    (tmp_path / "visit").mkdir()
    (tmp_path / "visit" / "walk.c3d").write_bytes(b"a recording")
    return tmp_path / "visit"


def run(session: Path, out: Path, files: dict[str, str], *, force: bool = False) -> Path | None:
    """Write a run's files and put them in place."""
    made = results_folder(out, session, force=force)
    for name, text in files.items():
        (made.part / name).write_text(text)
    walk = session / "walk.c3d"
    return made.finish(session, inputs_of({walk: file_hash(walk)}, session))


def content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.name != "manifest.json"}


FIRST = {"results.json": "{1}", "body.json": "of 64 kg", "subject.html": "hers"}
SECOND = {"results.json": "{2}", "report.html": "of 95 kg"}


def test_a_second_run_leaves_nothing_of_the_first_and_keeps_files_of_others(session: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run(session, out, FIRST) is None
    (out / "notes.txt").write_text("call her on Monday")
    (out / "figures").mkdir()
    (out / "figures" / "mine.png").write_text("drawn by hand")
    kept = run(session, out, SECOND, force=True)
    assert content(out) == SECOND
    assert kept == tmp_path / "out-kept"
    assert sorted(path.name for path in kept.rglob("*")) == ["figures", "mine.png", "notes.txt"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "out-kept", "visit"]


def test_results_of_a_version_without_manifest_are_replaced_too(session: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.json").write_text("{0}")
    (out / "report.html").write_text("old")
    assert run(session, out, SECOND, force=True) is None
    assert content(out) == SECOND


def test_a_full_disk_leaves_what_was_there(session: Path, tmp_path: Path, monkeypatch) -> None:
    run(session, tmp_path / "out", FIRST)

    def full(_: Path) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(rooms, "flush", full)
        with pytest.raises(SessionRefused, match=r"No space left on device.*as before"):
            run(session, tmp_path / "out", SECOND, force=True)
    assert content(tmp_path / "out") == FIRST


def test_where_names_cannot_be_exchanged_at_once_steps_do(session: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(rooms.ctypes, "CDLL", lambda *_, **__: object())
    run(session, tmp_path / "out", FIRST)
    run(session, tmp_path / "out", SECOND, force=True)
    assert content(tmp_path / "out") == SECOND


def test_a_place_that_is_a_disk_of_its_own_is_filled_from_within(session: Path, tmp_path: Path, monkeypatch) -> None:
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == out)
    run(session, out, FIRST)
    assert content(out) == FIRST
    run(session, out, SECOND, force=True)
    assert content(out) == SECOND


def test_a_folder_on_a_disk_of_its_own_holds_nothing_stale(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == tmp_path / "tables")
    for names in (("angles.csv", "findings.csv"), ("angles.csv",)):
        with whole_folder(tmp_path / "tables", over=True) as part:
            for name in names:
                (part / name).write_text("of this run")
    assert [path.name for path in (tmp_path / "tables").iterdir()] == ["angles.csv"]


def test_verify_finds_the_recordings_from_anywhere(session: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    run(Path("visit"), Path("out"), FIRST)
    monkeypatch.chdir("/")
    assert command(["verify", str(tmp_path / "out")]) == 0


def test_the_manifest_binds_the_parts_and_the_recordings(session: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(session, out, FIRST)
    manifest = read_manifest(out)
    assert manifest is not None
    assert set(manifest.outputs) == set(FIRST)
    assert manifest.inputs == {"walk.c3d": file_hash(session / "walk.c3d")}
    refuse_mixture(out, ("body.json", "motions.npz"))
    (out / "body.json").write_text("of 95 kg")
    with pytest.raises(FileRefused, match=r"body\.json: is not as its run wrote it"):
        refuse_mixture(out, ("body.json",))
    (out / "motions.npz").write_text("of another run")
    with pytest.raises(FileRefused, match="not of the run that wrote this folder"):
        refuse_mixture(out, ("motions.npz",))
    (out / "subject.html").unlink()
    (session / "walk.c3d").write_bytes(b"exported again")
    found = check_results(out)
    assert found is not None
    assert (found.changed, found.missing) == (("body.json",), ("subject.html",))
    assert [Path(one).name for one in found.inputs_changed] == ["walk.c3d"]
    assert not found.whole


def told(version: str, commit: str, **settings: object) -> str:
    """Return a results.json of which only the provenance matters."""
    return json.dumps({"provenance": {"versions": {"biodance": version}, "commit": commit, "settings": settings}})


def test_the_manifest_binds_commit_and_settings(session: Path, tmp_path: Path, capsys, monkeypatch) -> None:
    """Two runs with another cut-off, by another commit: each is whole, and `verify` says in what they differ."""
    commits = {"one": "a" * 40, "two": f"{'b' * 40}+changed"}
    for cutoff, (name, commit) in zip((6.0, 8.0), commits.items(), strict=True):
        monkeypatch.setattr(rooms, "commit", lambda commit=commit: commit)
        made = results_folder(tmp_path / "all" / name, session)
        (made.part / "results.json").write_text(told(rooms.__version__, commit, hip="hara", cutoff=cutoff))
        made.finish(session, {}, {"hip": "hara", "cutoff": cutoff})
    kept = read_manifest(tmp_path / "all" / "two")
    assert kept is not None
    assert (kept.commit, kept.settings) == (commits["two"], {"hip": "hara", "cutoff": 8.0})
    assert command(["verify", str(tmp_path / "all")]) == 0
    said = capsys.readouterr().out
    assert "one: whole, biodance 0.1.0, commit aaaaaaaaaaaa\n" in said
    assert "two: whole, biodance 0.1.0, commit bbbbbbbbbbbb+changed\n" in said
    assert "setting cutoff: 6.0 in 1, 8.0 in 1" in said
    assert "commit: aaaaaaaa" in said
    assert "hip" not in said
    results = tmp_path / "all" / "one" / "results.json"
    results.write_text(told("0.0.9", commits["two"], hip="hara", cutoff=8.0))
    assert command(["verify", str(tmp_path / "all" / "one")]) == 1
    said = capsys.readouterr().out
    assert "changed: results.json; manifest and results.json differ in: version, commit, setting cutoff" in said


def test_a_manifest_from_before_commit_and_settings_is_read(session: Path, tmp_path: Path) -> None:
    run(session, tmp_path / "out", {"results.json": told("0.1.0", "c" * 40, hip="hara")})
    path = tmp_path / "out" / "manifest.json"
    earlier = {key: one for key, one in json.loads(path.read_text()).items() if key not in ("commit", "settings")}
    path.write_text(json.dumps(earlier))
    found = check_results(tmp_path / "out")
    assert found is not None
    assert found.whole
    assert (found.manifest.commit, found.otherwise) == ("unknown", ())


@pytest.mark.parametrize("text", ["", "{", "[]", json.dumps({"run": "1"})])
def test_a_damaged_manifest_is_one_sentence(session: Path, tmp_path: Path, text: str) -> None:
    run(session, tmp_path / "out", FIRST)
    (tmp_path / "out" / "manifest.json").write_text(text)
    with pytest.raises(FileRefused, match=r"manifest\.json: is damaged .*Run the session again"):
        read_manifest(tmp_path / "out")


def test_verify_tells_whole_results_from_changed_ones(session: Path, tmp_path: Path, capsys) -> None:
    run(session, tmp_path / "all" / "one", FIRST)
    run(session, tmp_path / "all" / "two", FIRST)
    assert command(["verify", str(tmp_path / "all")]) == 0
    assert capsys.readouterr().out.count(": whole, biodance ") == 2
    (tmp_path / "all" / "two" / "body.json").write_text("of 95 kg")
    assert command(["verify", str(tmp_path / "all"), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert [(one["whole"], one["changed"]) for one in found] == [(True, []), (False, ["body.json"])]
    assert command(["verify", str(session)]) == 2
    assert "holds no results" in capsys.readouterr().err
