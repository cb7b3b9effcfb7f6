"""One session gives the same results.json on any number of threads, with any hash seed, in any locale and folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import biodance

SURROUNDINGS = (
    {"PYTHONHASHSEED": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "LC_ALL": "C"},
    {
        "PYTHONHASHSEED": "77",
        "OMP_NUM_THREADS": "2",
        "OPENBLAS_NUM_THREADS": "2",
        "LC_ALL": "C.UTF-8",
        "TZ": "Asia/Tokyo",
    },
)
OF_THE_RUN = re.compile(r'"(created_utc|blas)": *"[^"]*"')
"""What a run says of itself: when it was, and on how many threads."""


def test_results_are_the_same_bytes_in_other_surroundings(tmp_path: Path) -> None:
    session = tmp_path / "session"
    biodance.simulate(biodance.Subject(61.0, 1.68, "F", 30.0), "standing", session, seed=3)
    found = []
    for number, surrounding in enumerate(SURROUNDINGS):
        here = tmp_path / str(number)
        here.mkdir()
        paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
        words = [sys.executable, "-m", "biodance", "report", str(session), "--out", "results"]
        subprocess.run(words, cwd=here, env=os.environ | paths | surrounding, capture_output=True, check=False)
        text = (here / "results" / "results.json").read_text(encoding="utf-8")
        found.append(OF_THE_RUN.sub("", text))
    assert found[0] == found[1]
    assert len(found[0]) > 10_000
