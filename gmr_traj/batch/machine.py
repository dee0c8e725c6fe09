"""How many clips this machine can do at the same time."""

from __future__ import annotations

import os
from pathlib import Path


def default_jobs(threads: int, memory: int) -> int:
    """As many as there are cores for, and memory if each takes all it may; at least one.

    Args:
        threads: of one clip.
        memory: that one clip may take [bytes].
    """
    return max(1, min(len(os.sched_getaffinity(0)) // threads, _available_memory() // memory))


def _available_memory() -> int:
    """Memory that is free for the asking [bytes], that of the container where it has less."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    free = next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    cap = Path("/sys/fs/cgroup/memory.max")
    text = cap.read_text().strip() if cap.is_file() else "max"
    return free if text == "max" else min(free, int(text))
