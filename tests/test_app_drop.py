"""A folder that is dropped on the window: copied whole or not at all, beside the results, and run."""

import errno
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from lab_sessions import two_trials, write_trial
from starlette.testclient import TestClient

from biodance.app.server import window_application
from biodance.app.sessions import Archive
from biodance.app.window import Window

PORT, TOKEN = 8124, "a-token"
HOME = f"http://127.0.0.1:{PORT}"
HEADERS = {"origin": HOME, "content-type": "application/octet-stream"}


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    two_trials(tmp_path / "archive")
    return Archive(tmp_path / "archive", tmp_path / "results")


@pytest.fixture
def user(archive: Archive) -> Iterator[TestClient]:
    application = window_application(Window(archive), token=TOKEN, port=PORT)
    with TestClient(application, base_url=HOME, follow_redirects=False) as client:
        client.get(f"/?token={TOKEN}")
        yield client


@pytest.fixture
def recording(tmp_path: Path) -> bytes:
    return write_trial(tmp_path / "stick", "static", mass=None).read_bytes()


def body(name: str, **files: bytes) -> bytes:
    head = {"name": name, "files": [[path, len(content)] for path, content in files.items()]}
    return json.dumps(head).encode() + b"\n" + b"".join(files.values())


def dropped(user: TestClient, name: str, files: dict[str, bytes]) -> dict:
    answer = user.post("/api/drop", content=body(name, **files), headers=HEADERS)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_dropped_folder_is_a_session_of_the_window_and_what_was_open_is_untouched(user, archive, recording):
    before = {path: path.stat() for path in archive.folder.rglob("*")}
    told = dropped(user, "S07", {"static.trc": recording, "notes/empty.txt": b""})
    folder = archive.out / "dropped" / "S07"
    assert (told["names"], told["folder"]) == (["S07"], str(folder.parent))
    assert (folder / "static.trc").read_bytes() == recording
    assert (folder / "notes" / "empty.txt").read_bytes() == b""
    assert user.get("/api/session", params={"name": "S07"}).json()["why"] == ""
    assert before == {path: path.stat() for path in archive.folder.rglob("*")}


def test_the_same_folder_again_is_the_same_session_and_another_of_its_name_is_a_new_one(user, recording):
    dropped(user, "S07", {"static.trc": recording})
    revision = user.get("/api/session", params={"name": "S07"}).json()["revision"]
    change = {"name": "S07", "revision": revision, "changes": [[["subject", "age"], 30]]}
    user.post("/api/edit", json=change, headers=HEADERS | {"content-type": "application/json"})
    again = dropped(user, "S07", {"static.trc": recording, "session.toml": b"[subject]\nage = 3\n"})
    assert (again["names"], len(again["rows"])) == (["S07"], 1)
    assert "age = 30" in user.get("/api/session", params={"name": "S07"}).json()["text"]
    other = dropped(user, "S07", {"walk.trc": recording})
    assert (other["names"], len(other["rows"])) == (["S07 2"], 2)


def test_an_archive_that_is_dropped_shows_all_its_sessions(user, recording):
    told = dropped(user, "study", {"S1/static.trc": recording, "S2/static.trc": recording})
    assert told["names"] == ["study/S1", "study/S2"]


@pytest.mark.parametrize(
    ("head", "content"),
    [
        ({"name": "S07", "files": [["static.trc", 10]]}, b"123"),
        ({"name": "S07", "files": [["../static.trc", 1]]}, b"1"),
        ({"name": "S07", "files": [["/tmp/static.trc", 1]]}, b"1"),
        ({"name": "S07", "files": [["a//b.trc", 1]]}, b"1"),
        ({"name": "..", "files": [["static.trc", 1]]}, b"1"),
        ({"name": "S07", "files": [["readme.txt", 1]]}, b"1"),
        ({"name": "S07"}, b""),
        ([], b""),
    ],
)
def test_what_is_no_session_or_broke_off_is_said_and_leaves_nothing(user, archive, tmp_path, head, content):
    answer = user.post("/api/drop", content=json.dumps(head).encode() + b"\n" + content, headers=HEADERS)
    assert answer.status_code == 400
    assert answer.json()["error"].endswith((".", ".)"))
    assert not [*(archive.out / "dropped").rglob("*")]
    assert {path.name for path in tmp_path.iterdir()} == {"archive", "results"}
    assert user.get("/api/listed").json()["folder"] == str(archive.folder)


def test_on_a_full_disk_nothing_of_a_drop_stays(user, archive, recording, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "static.trc")

    monkeypatch.setattr("biodance.app.dropped._kept", full)
    answer = user.post("/api/drop", content=body("S07", **{"static.trc": recording}), headers=HEADERS)
    assert answer.status_code == 507
    assert "No space left" in answer.json()["error"]
    assert not [*(archive.out / "dropped").rglob("*")]


def test_nothing_is_taken_in_from_another_page_or_without_the_token(user, archive, recording):
    content = body("S07", **{"static.trc": recording})
    assert user.post("/api/drop", content=content, headers=HEADERS | {"origin": "http://a.com"}).status_code == 403
    assert user.post("/api/drop", content=content, headers=HEADERS | {"content-type": "text/plain"}).status_code == 403
    user.cookies.clear()
    assert user.post("/api/drop", content=content, headers=HEADERS).status_code == 403
    assert not (archive.out / "dropped").exists()
