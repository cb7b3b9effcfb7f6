"""Arrays of records: nobody can write into them, and what a record froze is shared and not copied again."""

import numpy as np
import pytest

from biodance.errors import BiodanceError
from biodance.records import Wrench
from biodance.records.arrays import frozen_array


def test_what_was_frozen_is_shared_and_anything_else_copied() -> None:
    own = frozen_array(np.zeros((4, 3)), (None, 3), "x")
    assert frozen_array(own, (4, None), "x") is own
    whole = np.zeros(4, dtype=int)
    whole.setflags(write=False)
    for other in (np.zeros(4), whole, own[:, 0], [0.0] * 4):
        kept = frozen_array(other, (4,), "x")
        assert kept is not other
        assert kept.dtype == float
        assert not kept.flags.writeable
        assert kept.base is None


def test_who_wrote_into_an_array_that_a_record_took_changes_no_record() -> None:
    time, value = np.arange(3.0), np.zeros((3, 6))
    wrench = Wrench(time, value)
    time[0], value[0, 0] = 7.0, 7.0
    assert wrench.time[0] == 0.0
    assert wrench.value[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        wrench.value[0, 0] = 1.0


def test_another_shape_is_refused_with_both() -> None:
    with pytest.raises(BiodanceError, match=r"x has shape \(2, 2\), expected \(any, 3\)"):
        frozen_array(np.zeros((2, 2)), (None, 3), "x")
