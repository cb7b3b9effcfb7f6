"""What benchmarks keep between runs is made once and bounded: what was used longest ago is forgotten first."""

import importlib.util
import os
import sys
from pathlib import Path

SPEC = importlib.util.spec_from_file_location("kept_files", Path(__file__).parents[1] / "benchmarks" / "kept_files.py")
assert SPEC is not None
assert SPEC.loader is not None
kept_files = importlib.util.module_from_spec(SPEC)
sys.modules[SPEC.name] = kept_files
SPEC.loader.exec_module(kept_files)


def test_what_is_kept_is_made_once(tmp_path: Path) -> None:
    made: list[int] = []
    for _ in range(2):
        assert kept_files.kept(tmp_path / "in" / "one.pickle", lambda: made.append(1) or "answer") == "answer"
    assert made == [1]


def test_what_is_of_records_that_have_moved_is_made_anew(tmp_path: Path) -> None:
    for name, gone in {
        "module": b"cbiodance.no_such_room\nRecord\n.",
        "record": b"cbiodance.records\nNoSuch\n.",
    }.items():
        (tmp_path / f"{name}.pickle").write_bytes(gone)
        for made in ("anew", "never"):
            assert kept_files.kept(tmp_path / f"{name}.pickle", lambda made=made: made) == "anew"


def test_what_was_used_longest_ago_goes_first_and_the_newest_stays(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(kept_files, "MOST", 2.5e-5)  # 25 kB
    paths = [tmp_path / f"{name}.pickle" for name in "abc"]
    (tmp_path / "scores.json").write_text("x" * 100_000)
    for k, path in enumerate(paths[:2]):
        kept_files.store(path, bytes(10_000))
        os.utime(path, (k, k))
    kept_files.kept(paths[0], lambda: None)
    kept_files.store(paths[2], bytes(10_000))
    assert [path.exists() for path in paths] == [True, False, True]
    kept_files.store(paths[1], bytes(100_000))
    assert [path.exists() for path in paths] == [False, True, False]
    assert (tmp_path / "scores.json").exists()
