"""Faults written into real walks: the benchmark that counts what is named runs, with a session as it was recorded."""

from pathlib import Path

from benchmarks.walks import scored


def test_nothing_is_named_in_a_walk_as_it_was_recorded(data: Path, tmp_path: Path) -> None:
    first = next(scored(data, "c3d_parser_Sydney", tmp_path))
    assert (first.fault.text, first.told, first.others) == ("", "", ())
