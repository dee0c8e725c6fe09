"""Runs of true frames."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gmr_traj.runs import runs


@given(st.lists(st.booleans(), max_size=40))
def test_runs_cover_the_true_frames_and_do_not_touch(mask: list[bool]) -> None:
    found = runs(np.array(mask, bool))
    covered = np.zeros(len(mask), bool)
    for start, stop in found:
        covered[start:stop] = True
    np.testing.assert_array_equal(covered, mask)
    assert all(start < stop for start, stop in found)
    assert all(stop < start for (_, stop), (start, _) in pairwise(found))
