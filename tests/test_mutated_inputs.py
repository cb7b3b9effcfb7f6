"""Damaged files of every kind end in a refusal, the same numbers, or what the damaged place says: no traceback, no
hang, nothing infinite. BIODANCE_MUTATIONS=2000 does as many.
"""

import os
import zlib
from pathlib import Path

import numpy as np
import pytest
from mutated_inputs import INPUTS, MUTATIONS, Input, bsf_input, judged

MANY = int(os.environ.get("BIODANCE_MUTATIONS", "100"))
_EACH = -(-MANY // (len(INPUTS) + 1))
_BYTES_ALONE = ("byte", "cut", "lost", "put_in", "rows", "deep")
"""What can happen to a file that is no text."""


def all_judged(kind: Input, folder: Path, seed: int) -> list[tuple[str, str]]:
    """Mutate a sound file `_EACH` times; return kind of mutation and what became of it."""
    path = folder / kind.name
    kind.written(path)
    content, sound = path.read_bytes(), kind.read(path)
    assert judged(kind, path, sound) == "same"
    rng, found = np.random.default_rng(seed), []
    for number in range(_EACH):
        what = str(rng.choice(list(MUTATIONS) if kind.text else _BYTES_ALONE))
        path.write_bytes(MUTATIONS[what](content, rng))
        try:
            found.append((what, judged(kind, path, sound)))
        except BaseException as error:
            raise AssertionError(f"{kind.name}, mutation {number} ({what}), seed {seed}: {error!r}") from error
    return found


@pytest.mark.parametrize("name", INPUTS)
def test_damaged_files_are_refused_or_read_for_what_they_say(name: str, tmp_path: Path) -> None:
    found = all_judged(INPUTS[name], tmp_path, zlib.crc32(name.encode()))
    ends = {end for _, end in found}
    assert ends - {"same"}, "something was damaged"
    assert "refused without a word" not in ends
    silent = [one for one in found if one[1].startswith("other data") and one[1].endswith("said: []")]
    if name == "results":
        assert not silent, "the manifest knows every byte"
    else:
        assert not [one for one in found if one[0] == "coding" and one[1] not in ("same", "refused")]


def test_damaged_bsf_files_are_refused_or_read_for_what_they_say(data: Path, tmp_path: Path) -> None:
    assert all_judged(bsf_input(data / "amti" / "AMTIdata.bsf"), tmp_path, 1)
