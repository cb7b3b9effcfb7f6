"""The window's server: who is let in, what can be asked for, what is written to session.toml, and its undoing."""

import errno
import io
import json
import socket
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from lab_sessions import two_trials, write_trial
from starlette.testclient import TestClient

from biodance.app.server import LARGEST_BODY, POLICY, serve_window, window_application
from biodance.app.sessions import Archive
from biodance.app.window import Window
from biodance.errors import BiodanceError
from biodance.library import names
from biodance.report.pages.template import template_text, three_js

PORT, TOKEN = 8123, "a-token"
HOME = f"http://127.0.0.1:{PORT}"
JSON = {"content-type": "application/json"}
ORIGIN = {"origin": HOME, **JSON}
NAME = "S01/visit"


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    two_trials(tmp_path / "archive")
    write_trial(tmp_path / "archive" / "S02", "static")
    return Archive(tmp_path / "archive", tmp_path / "results")


@pytest.fixture
def stranger(archive: Archive) -> Iterator[TestClient]:
    application = window_application(Window(archive), token=TOKEN, port=PORT)
    with TestClient(application, base_url=HOME, follow_redirects=False) as client:
        yield client


@pytest.fixture
def user(stranger: TestClient) -> TestClient:
    answer = stranger.get(f"/?token={TOKEN}")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/"
    return stranger


def post(user: TestClient, path: str, **body) -> dict:
    answer = user.post(f"/api/{path}", json=body, headers=ORIGIN)
    assert answer.status_code == 200, answer.text
    return answer.json()


def viewed(user: TestClient, name: str = NAME) -> dict:
    answer = user.get("/api/session", params={"name": name})
    assert answer.status_code == 200, answer.text
    return answer.json()


def edited(user: TestClient, *changes, name: str = NAME) -> dict:
    return post(user, "edit", name=name, revision=viewed(user, name)["revision"], changes=changes)


def session_toml(archive: Archive, name: str = NAME) -> Path:
    return archive[name].folder / "session.toml"


def test_without_the_token_nothing_is_answered(stranger):
    for path in ("/", "/?token=wrong", "/static/main.js", "/api/listed", "/page?name=S02"):
        assert stranger.get(path).status_code == 403, path
    assert stranger.post("/api/stop", json={}, headers=ORIGIN).status_code == 403


def test_the_cookie_is_for_this_page_alone(stranger):
    said = stranger.get(f"/?token={TOKEN}").headers["set-cookie"].lower()
    assert "samesite=strict" in said
    assert "httponly" in said


@pytest.mark.parametrize("host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1", "127.0.0.1:1", ""])
def test_another_name_for_this_machine_is_refused(user, host):
    assert user.get("/api/listed", headers={"host": host}).status_code == 403
    assert user.get("/api/listed").status_code == 200
    assert user.get("/api/listed", headers={"host": f"localhost:{PORT}"}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [JSON, {"origin": "http://evil.example", **JSON}, {"origin": "null", **JSON}, {"origin": HOME},
     {"origin": HOME, "content-type": "text/plain"}],
)  # fmt: skip
def test_a_change_that_another_page_sends_is_refused(user, archive, headers):
    body = json.dumps({"name": NAME, "revision": viewed(user)["revision"], "changes": [[["subject", "age"], 30]]})
    assert user.post("/api/edit", content=body, headers=headers).status_code == 403
    assert not session_toml(archive).exists()


def test_every_answer_says_what_its_page_may_do(user):
    assert user.get("/").headers["content-security-policy"] == POLICY
    assert "'unsafe" not in POLICY
    for path in ("/", "/static/main.js", "/api/listed", "/nowhere"):
        assert user.get(path).headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("name", ["../main.js", "..%2f..%2fserver.py", "main.py", "%2e%2e/guard.py"])
def test_no_other_file_can_be_asked_for(user, name):
    assert user.get(f"/static/{name}").status_code == 404


@pytest.mark.parametrize("name", ["../archive/S02", "/etc", "S01/../S02", "S01"])
def test_no_other_folder_can_be_asked_for(user, name):
    for path in ("api/session", "page", "download"):
        answer = user.get(f"/{path}", params={"name": name, "format": "xlsx"})
        assert answer.status_code == 404
    assert "Legal" in user.get("/api/session", params={"name": name}).json()["error"]


def test_a_huge_body_is_refused(user):
    assert user.post("/api/edit", content=b"{" * (LARGEST_BODY + 1), headers=ORIGIN).status_code == 413
    sent = iter([b"[" * 1000] * (LARGEST_BODY // 1000 + 2))  # no length is told
    assert user.post("/api/edit", content=sent, headers=ORIGIN).status_code == 413


@pytest.mark.parametrize("content", [b"{", b"[]", b"\xff", b"[" * 100_000, b'{"name": 3}', b"{}"])
def test_what_is_no_question_gets_a_sentence(user, content):
    answer = user.post("/api/edit", content=content, headers=ORIGIN)
    assert answer.status_code in (400, 404)
    assert answer.json()["error"].endswith(".")


def test_the_list_names_every_session(user):
    rows = user.get("/api/listed").json()["rows"]
    assert [(row["name"], row["found"]) for row in rows] == [(NAME, None), ("S02", None)]


def test_a_session_is_shown_with_its_guesses(user):
    found = viewed(user)
    assert {row["stem"]: (row["role"], row["told"]) for row in found["trials"]} == {
        "static01": ("static", False),
        "squat_1": ("validate", False),
    }
    assert found["subject"]["sex"]["guessed"]
    assert {row["label"]: row["place"] for row in found["markers"]["labels"]}["LASI"] == "left_asis"
    assert found["plates"][0]["name"] == "plate1"


def test_a_change_is_written_with_comments_kept(user, archive):
    session_toml(archive).write_text("# mine\n[subject] # hers\nage = 30 # years\n", encoding="utf-8")
    found = edited(user, [["subject", "mass_kg"], 62.5], [["trials", "squat_1", "role"], "fit"])
    text = session_toml(archive).read_text(encoding="utf-8")
    assert text.startswith("# mine\n[subject] # hers\nage = 30 # years\n")
    assert tomllib.loads(text) == {"subject": {"age": 30, "mass_kg": 62.5}, "trials": {"squat_1": {"role": "fit"}}}
    assert {row["stem"]: (row["role"], row["told"]) for row in found["trials"]}["squat_1"] == ("fit", True)
    assert found["subject"]["mass_kg"]["value"] == 62.5


@pytest.mark.parametrize(
    ("keys", "value", "word"),
    [
        (["subject", "mass_kg"], 6250, "mass_kg"),
        (["subject", "mass_kg"], "much", "mass_kg"),
        (["subject", "mas_kg"], 62, "mass_kg"),
        (["trials", "squat_1", "role"], "dance", "role"),
        (["plates", "plate1", "corners_m"], [[0, 0, 0]], "corners_m"),
        (["devices", "left_wing"], 1, "left_wing"),
        (["markers", "map"], {"LASI": "left_asi"}, "left_asi"),
        ([], 1, "key"),
        (["subject", 3], 1, "key"),
        (["subject", "girths_cm", "a", "b", "c", "d"], 1, "key"),
    ],
)
def test_a_value_that_is_not_legal_is_refused_and_nothing_is_written(user, archive, keys, value, word):
    body = {"name": NAME, "revision": viewed(user)["revision"], "changes": [[keys, value]]}
    answer = user.post("/api/edit", json=body, headers=ORIGIN)
    assert answer.status_code == 400
    assert word in answer.json()["error"]
    assert not session_toml(archive).exists()


def test_who_has_not_seen_the_newest_file_is_told(user, archive):
    seen = viewed(user)["revision"]
    session_toml(archive).write_text("[subject]\nage = 44\n", encoding="utf-8")
    body = {"name": NAME, "revision": seen, "changes": [[["subject", "age"], 30]]}
    answer = user.post("/api/edit", json=body, headers=ORIGIN)
    assert answer.status_code == 409
    assert "changed elsewhere" in answer.json()["error"]
    assert "age = 44" in session_toml(archive).read_text(encoding="utf-8")
    assert user.get("/api/state", params={"name": NAME}).json()["revision"] != seen


def test_every_change_is_undone_and_done_again_also_by_another_window(user, archive):
    session_toml(archive).write_text("# mine\n", encoding="utf-8")
    states = ["# mine\n"]
    for age in (30, 40, 50):
        found = edited(user, [["subject", "age"], age])
        states.append(found["text"])
    assert found["undo"]
    assert not found["redo"]
    for text in states[2:0:-1]:
        found = post(user, "undo", name=NAME, revision=found["revision"])
        assert found["text"] == text
    found = post(user, "redo", name=NAME, revision=found["revision"])
    assert found["text"] == states[2]
    again = Archive(archive.folder, archive.out)[NAME].file
    assert again.steps[0]
    kept = {path.read_text(encoding="utf-8") for path in (archive.out / "history").rglob("*.toml")}
    assert kept == set(states)


def test_a_change_after_an_undo_loses_nothing(user, archive):
    first = edited(user, [["subject", "age"], 30])["text"]
    second = edited(user, [["subject", "age"], 40])
    post(user, "undo", name=NAME, revision=second["revision"])
    third = edited(user, [["subject", "age"], 50])
    back = post(user, "undo", name=NAME, revision=third["revision"])
    assert back["text"] == first
    kept = {path.read_text(encoding="utf-8") for path in (archive.out / "history").rglob("*.toml")}
    assert kept == {"", first, second["text"], third["text"]}


def test_what_an_editor_wrote_is_kept_before_it_is_changed_and_undone(user, archive):
    edited(user, [["subject", "age"], 30])
    session_toml(archive).write_text("# by hand\n", encoding="utf-8")
    found = viewed(user)
    assert found["undo"]
    back = post(user, "undo", name=NAME, revision=found["revision"])
    assert "age = 30" in back["text"]
    assert post(user, "redo", name=NAME, revision=back["revision"])["text"] == "# by hand\n"


def test_the_first_undo_takes_the_file_away_that_the_first_change_made(user, archive):
    found = edited(user, [["subject", "age"], 30])
    found = post(user, "undo", name=NAME, revision=found["revision"])
    assert found["text"] == ""
    assert not session_toml(archive).exists()


def test_a_key_taken_out_takes_its_empty_table_along(user, archive):
    edited(user, [["trials", "squat_1", "role"], "fit"], [["subject", "age"], 30])
    edited(user, [["trials", "squat_1", "role"], None])
    assert tomllib.loads(session_toml(archive).read_text(encoding="utf-8")) == {"subject": {"age": 30}}


def test_on_a_full_disk_the_file_stays_and_the_window_says_why(user, archive, monkeypatch):
    edited(user, [["subject", "age"], 30])
    before, seen = session_toml(archive).read_bytes(), viewed(user)["revision"]

    def full(path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with monkeypatch.context() as disk:
        disk.setattr("biodance.lab.plain_text.flush", full)
        body = {"name": NAME, "revision": seen, "changes": [[["subject", "age"], 40]]}
        answer = user.post("/api/edit", json=body, headers=ORIGIN)
    assert answer.status_code == 400
    assert "No space left" in answer.json()["error"]
    assert session_toml(archive).read_bytes() == before
    assert edited(user, [["subject", "age"], 40])["subject"]["age"]["value"] == 40


def test_markers_are_exchanged_dropped_and_mapped(user):
    found = edited(
        user,
        [["trials", "squat_1", "exchange"], [["LKNE", "RKNE", 0.1, 0.5]]],
        [["markers", "drop"], ["T10"]],
        [["markers", "map"], {"LASI": "left_asis", "RASI": "right_asis", "SACR": "mid_psis"}],
    )
    assert {row["stem"]: row["exchange"] for row in found["trials"]}["squat_1"] == [["LKNE", "RKNE", 0.1, 0.5]]
    rows = {row["label"]: row for row in found["markers"]["labels"]}
    assert "T10" not in rows
    assert rows["LASI"]["by"] == "map"
    assert rows["LKNE"]["by"] == "nobody"
    drawn = user.get("/api/markers", params={"name": NAME, "trial": "squat_1"}).json()
    assert "T10" not in drawn["names"]
    assert drawn["frames"] == 100


def test_a_plate_is_switched_off_and_on_again(user):
    found = edited(user, [["plates", "plate1", "use"], False])
    assert found["plates"] == [{"name": "plate1", "use": False, "foot": ""}]
    found = edited(user, [["plates", "plate1", "use"], None])
    assert found["plates"][0]["use"]
    assert len(found["plates"][0]["corners_m"]) == 4


def test_forces_are_drawn(user):
    found = user.get("/api/forces", params={"name": NAME, "trial": "squat_1"}).json()
    assert max(found["plates"][0]["force_n"]) == pytest.approx(608, abs=5)
    assert found["ends_s"] == pytest.approx([0, 0.999], abs=0.01)


def test_a_session_that_cannot_be_read_is_mended_as_text(user, archive):
    session_toml(archive).write_text("[subject]\nmass_kg = 62,5\n", encoding="utf-8")
    found = viewed(user)
    assert "line 2" in found["why"]
    assert "trials" not in found
    wrong = {"name": NAME, "revision": found["revision"], "text": "[subject]\nmass_kg = 1\n"}
    assert user.post("/api/text", json=wrong, headers=ORIGIN).status_code == 400
    found = post(user, "text", name=NAME, revision=found["revision"], text="[subject]\nmass_kg = 62.5\n")
    assert found["why"] == ""
    assert found["undo"]


def test_results_that_are_not_there_are_asked_for_in_vain(user):
    files = [{"format": "file", "file": "../../x"}, {"format": "exe"}, {"format": "xlsx"}]
    for path, query in [("api/results", {}), ("page", {}), *(("download", one) for one in files)]:
        answer = user.get(f"/{path}", params={"name": NAME, **query})
        assert answer.status_code in (400, 404), path
        assert "error" in answer.json()


def test_a_part_of_the_page_stands_alone_and_can_do_nothing_to_the_window(user, archive):
    folder = archive[NAME].results
    folder.mkdir(parents=True)
    text = '<html><head></head><body><header></header><main><section id="{}"></section></main></body></html>'
    (folder / "report.html").write_text(text.format("movement"), encoding="utf-8")
    answer = user.get("/page", params={"name": NAME, "part": "gait"})
    assert "main > :not(#movement) { display: none; }" in answer.text
    assert "allow-same-origin" not in answer.headers["content-security-policy"]
    assert answer.headers["content-security-policy"].startswith("sandbox ")
    assert "nothing to show" in user.get("/page", params={"name": NAME, "part": "body"}).text
    assert user.get("/page", params={"name": NAME}).text == text.format("movement")
    (folder / "report.html").write_text(text.format("checks"), encoding="utf-8")
    assert "No whole gait cycle" in user.get("/page", params={"name": NAME, "part": "gait"}).text


def test_a_browser_builds_the_picture_in_space_only_where_it_is_shown(user, archive):
    folder = archive[NAME].results
    folder.mkdir(parents=True)
    scripts = "".join(f"<script>{text}</script>" for text in (template_text("curves.js"), three_js()))
    text = f'<html><head></head><body><section id="movement"></section><section id="replay"></section>{scripts}</body>'
    (folder / "report.html").write_text(text, encoding="utf-8")
    drawn = {part: user.get("/page", params={"name": NAME, "part": part}).text for part in ("gait", "body")}
    assert three_js() not in drawn["gait"]
    assert template_text("curves.js") in drawn["gait"]
    assert three_js() in drawn["body"]


@pytest.mark.parametrize("out", [".", "archive", "archive/S02/.."])
def test_results_do_not_go_among_recordings(archive, tmp_path, out):
    with pytest.raises(BiodanceError, match="among the recordings"):
        Archive(archive.folder, tmp_path / out)


def test_a_port_that_another_program_has_is_refused(archive, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(BiodanceError, match=f"--port {port}.*Give another one, or 0 for any"):
            serve_window(archive.folder, tmp_path / "results", port=port, opened=False)


def test_a_folder_without_a_session_is_refused(tmp_path):
    with pytest.raises(BiodanceError, match="no session"):
        Archive(tmp_path, tmp_path.with_name("results"))


def test_zip_of_tables_and_workbook(user, archive):
    """Tables of a run as they would be found, with a text that a spreadsheet would take for a formula."""
    import pandas as pd

    from biodance.report.files import write_tables

    folder = archive[NAME].results / "tables"
    folder.mkdir(parents=True)
    write_tables({"trials": pd.DataFrame({"name": ["=1+1", "squat"], "mass (kg)": [float("nan"), 62.5]})}, folder)
    packed = zipfile.ZipFile(io.BytesIO(user.get("/download", params={"name": NAME, "format": "csv"}).content))
    assert packed.namelist() == ["trials.csv"]
    answer = user.get("/download", params={"name": NAME, "format": "xlsx"})
    assert answer.headers["content-disposition"] == 'attachment; filename="visit.xlsx"'
    book = zipfile.ZipFile(io.BytesIO(answer.content))
    sheet = book.read("xl/worksheets/sheet2.xml").decode()
    assert "<v>62.5</v>" in sheet
    assert "<f>" not in sheet
    assert "'=1+1" in book.read("xl/sharedStrings.xml").decode()


def strike(time: float, kind: str = "strike") -> dict:
    return {"side": "left", "kind": kind, "time": time}


def test_steps_are_set_by_hand_and_undone(user, archive):
    some = [strike(0.2), strike(0.6, "off")]
    told = edited(user, [["trials", "squat_1", "events"], some])
    (row,) = [one for one in told["trials"] if one["stem"] == "squat_1"]
    assert row["events"] == [
        {"time_s": 0.2, "side": "left", "down": True, "source": "hand"},
        {"time_s": 0.6, "side": "left", "down": False, "source": "hand"},
    ]
    assert tomllib.loads(session_toml(archive).read_text())["trials"]["squat_1"]["events"] == some
    back = post(user, "undo", name=NAME, revision=told["revision"])
    assert all(one["events"] == [] for one in back["trials"])


def test_what_steps_change_is_not_told_before_a_run(user):
    answer = user.get("/api/strides", params={"name": NAME, "trial": "squat_1"})
    assert answer.status_code == 400
    assert "no results yet" in answer.json()["error"]


def test_a_strike_without_a_foot_off_is_refused_and_nothing_written(user, archive):
    body = {"name": NAME, "revision": viewed(user)["revision"]}
    changes = [[["trials", "squat_1", "events"], [strike(0.2), strike(0.6)]]]
    answer = user.post("/api/edit", json={**body, "changes": changes}, headers=ORIGIN)
    assert answer.status_code == 400
    assert "no off between" in answer.json()["error"]
    assert not session_toml(archive).exists()


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    write_trial(tmp_path / "home" / "study" / "S09", "static")
    write_trial(tmp_path / "elsewhere" / "S08", "static")
    (tmp_path / "home" / "way_out").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "home" / ".hidden").mkdir()
    return tmp_path / "home"


def test_another_folder_of_the_home_is_found_and_opened(home, user):
    told = user.get("/api/folders", params={"folder": str(home)}).json()
    assert told["folders"] == ["study"]  # neither hidden folders nor links that lead elsewhere
    assert told["above"] == ""
    assert user.get("/api/folders", params={"folder": str(home / "study")}).json()["above"] == str(home)
    opened = post(user, "open", folder=str(home / "study"))
    assert [row["name"] for row in opened["rows"]] == ["S09"]
    assert opened["out"] == str(home / "study-results")
    assert viewed(user, "S09")["why"] == ""
    assert user.get("/api/session", params={"name": NAME}).status_code == 404


@pytest.mark.parametrize(
    "path", ["/", "/etc", "elsewhere", "home/way_out", "home/../elsewhere", "home/nobody", "home/\0"]
)
def test_no_folder_elsewhere_is_shown_or_opened(home, user, path):
    path = path if path.startswith("/") else f"{home.parent}/{path}"
    shown = user.get("/api/folders", params={"folder": path})
    opened = user.post("/api/open", json={"folder": path}, headers=ORIGIN)
    assert (shown.status_code, opened.status_code) == (400, 400)
    assert "folders" not in shown.json()
    assert viewed(user)["why"] == ""  # what was open stays open


def test_a_folder_without_a_session_leaves_what_is_open(home, user):
    (home / "empty").mkdir()
    answer = user.post("/api/open", json={"folder": str(home / "empty")}, headers=ORIGIN)
    assert answer.status_code == 400
    assert viewed(user)["why"] == ""
    assert not (home / "empty-results").exists()


def test_a_stranger_sees_no_folder(home, stranger):
    assert stranger.get("/api/folders", params={"folder": str(home)}).status_code == 403
    assert stranger.post("/api/open", json={"folder": str(home)}, headers=ORIGIN).status_code == 403


def test_the_corrected_copies_among_the_results_are_opened_as_a_session(user, archive):
    copies = archive.out / "accepted" / "S02" / "corrected"
    write_trial(copies, "static")
    assert [row["name"] for row in post(user, "open", folder=str(copies))["rows"]] == ["corrected"]
    assert [one["stem"] for one in viewed(user, "corrected")["trials"]] == ["static"]


def test_the_form_is_asked_and_the_file_saved_through_the_server(user) -> None:
    assert set(user.get("/api/form").json()["templates"]) == {"nobody", *names("protocols/limits")}
    values = json.dumps({"seat_height_m": 0.5})
    found = user.get("/download", params={"format": "limits", "template": "nobody", "values": values})
    assert found.headers["content-disposition"] == 'attachment; filename="person.toml"'
    assert tomllib.loads(found.text) == {"seat_height_m": 0.5}
    for wrong in ("[]", "{", json.dumps({"seat_height_m": "high"})):
        answer = user.get("/download", params={"format": "limits", "template": "nobody", "values": wrong})
        assert answer.status_code == 400, wrong
