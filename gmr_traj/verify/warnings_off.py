"""MuJoCo's warnings, which it would write into a file where the user stands."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco


@contextmanager
def no_log_file() -> Iterator[None]:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the current folder.

    It warns where a simulation goes out of bounds. The plant notices that by itself and counts a fall; in the rollouts
    of a planner it is no more than a plan that is not taken.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
