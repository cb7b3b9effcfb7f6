"""The table of all demands on a diagnosis (benchmarks/bench_truth.py): what is counted where, and how it resumes."""

import sys

import bench_truth
import pytest
import truth_parts
from truth_parts import Job


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Return a function that runs the benchmark over two jobs, and the keys of what it ran."""
    ran = []

    def job(column, hits):
        def run():
            ran.append(column)
            return "said", {"walks without fault: a name": hits}

        return Job("walks", column, f"one of {column}", run)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["bench_truth.py", "--run", "x", "--part", "walks", *words])
        bench_truth.main()

    monkeypatch.setattr(bench_truth, "CACHE", tmp_path)
    monkeypatch.setattr(truth_parts, "walks", lambda: iter([job("own", [True, False]), job("family", [False] * 3)]))
    return run, ran


def test_a_run_that_was_stopped_goes_on_and_counts_every_session_once(asked, capsys):
    run, ran = asked
    run("--first", "1")
    assert ran == ["own"]
    run()
    assert ran == ["own", "family"]
    assert "| walks without fault: a name |  | - | - | 1 of 2 (50 %) | 0 of 3 (0 %) |" in capsys.readouterr().out


def test_no_time_prints_the_table_only(asked, capsys):
    run, ran = asked
    run("--minutes", "0")
    assert not ran
    assert capsys.readouterr().out.startswith("| demand | bar |")


def test_what_needs_data_that_are_not_there_is_left_out_with_a_word(asked, capsys, monkeypatch):
    run, ran = asked
    monkeypatch.setitem(bench_truth.COLUMNS, "own", "BIODANCE_NOT_THERE")
    run()
    assert ran == ["family"]
    assert "walks: left out what needs BIODANCE_NOT_THERE." in capsys.readouterr().out


def test_every_beginning_is_a_sample_of_the_whole():
    assert bench_truth.spread(range(20))[:3] == [0, 7, 14]
    assert sorted(bench_truth.spread(range(20))) == list(range(20))
