"""The table of mutants holds: every snippet occurs once, every test exists, and the runner tells killed from survived.

Nothing of biodance is broken here; `python tests/mutants.py` does that.
"""

import ast
import hashlib
from pathlib import Path

import drawn_mutants
import mutants
import pytest

CHECKOUT = Path(__file__).resolve().parents[1]


MUTANTS = mutants.read_mutants()
each_mutant = pytest.mark.parametrize("mutant", MUTANTS, ids=[one.name for one in MUTANTS])


@each_mutant
def test_the_snippet_occurs_once_and_its_tests_exist(mutant) -> None:
    text = (CHECKOUT / mutant.file).read_text(encoding="utf-8")
    assert mutants.broken_text(mutant, text) != text
    assert mutant.tests
    assert len(mutant.why) > 8
    for test in mutant.tests:
        file, *names = test.partition("[")[0].split("::")
        content = (CHECKOUT / file).read_text(encoding="utf-8")
        assert all(f"def {name}(" in content for name in names), f"{test} does not exist"


def test_every_limit_of_a_dance_has_a_mutant_of_safety() -> None:
    guarded = {Path(one.file).stem for one in MUTANTS if one.safety}
    limits = {path.stem for path in (CHECKOUT / "biodance" / "dance" / "limits").glob("[!_]*.py")}
    assert len(limits) >= 9
    assert limits | {"verify"} <= guarded


def test_a_snippet_that_is_not_there_once_is_refused() -> None:
    mutant = mutants.Mutant("m", "a.py", "x", "y", ("test_a.py",), "it matters")
    for text in ("no such thing", "x x", ""):
        with pytest.raises(ValueError, match=r"m: its snippet occurs \d times in a\.py"):
            mutants.broken_text(mutant, text)


def test_the_runner_tells_killed_from_survived_and_mends_what_it_broke(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mutants, "CHECKOUT", tmp_path)
    (tmp_path / "half.py").write_text("def half(x):\n    return x / 2  # exact\n")
    (tmp_path / "test_half.py").write_text("from half import half\n\ndef test_half():\n    assert half(4) == 2\n")
    lines = {"killed": "x / 3", "survived": "x / 2.0", "broken run": "x /"}
    for fate, new in lines.items():
        outcome = mutants.judge(
            tmp_path, mutants.Mutant(fate, "half.py", "x / 2", new, ("test_half.py",), "half of something")
        )
        assert outcome.fate == fate
        assert outcome.by.startswith("test_half.py::test_half") == (fate == "killed")
    assert (tmp_path / "half.py").read_text() == "def half(x):\n    return x / 2  # exact\n"


def test_the_digest_of_a_table_follows_its_mutant(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("a,1\n")
    digest = hashlib.sha256(b"a,1\n").hexdigest()
    (tmp_path / "t.toml").write_text(f'sha256 = "{digest}"\n')
    with mutants.broken(tmp_path, mutants.Mutant("m", "t.csv", "a,1", "a,2", ("test_a.py",), "it matters")):
        assert hashlib.sha256(b"a,2\n").hexdigest() in (tmp_path / "t.toml").read_text()
        assert (tmp_path / "t.csv").read_text() == "a,2\n"
    assert digest in (tmp_path / "t.toml").read_text()
    assert (tmp_path / "t.csv").read_text() == "a,1\n"


def test_a_result_holds_as_long_as_entry_file_and_tests_are_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mutants, "CHECKOUT", tmp_path)
    for name in ("a.py", "test_a.py"):
        (tmp_path / name).write_text("1")
    mutant = mutants.Mutant("m", "a.py", "1", "2", ("test_a.py::test",), "it matters")
    digests = [mutants.fingerprint(mutant)]
    for name in ("a.py", "test_a.py"):
        (tmp_path / name).write_text("1\n")
        digests.append(mutants.fingerprint(mutant))
    assert len(set(digests)) == 3
    assert mutants.fingerprint(mutant) == digests[-1]


def test_drawn_mutants_follow_the_seed_and_break_one_place_that_tests_guard() -> None:
    some = drawn_mutants.drawn(12, 7, ("batch", "registration"))
    assert some == drawn_mutants.drawn(12, 7, ("batch", "registration"))
    assert some != drawn_mutants.drawn(12, 8, ("batch", "registration"))
    assert [Path(one.file).parts[1] for one in some].count("batch") == 6
    for one in some:
        text = (CHECKOUT / one.file).read_text(encoding="utf-8")
        ast.parse(mutants.broken_text(one, text))
        assert f"tests/test_{Path(one.file).parts[1]}.py" in one.tests
