"""Freed memory is kept where the C library can."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="these settings are glibc's")
def test_freed_blocks_are_used_again() -> None:
    # In a process of its own: the settings are the process's.  Pages that are mapped afresh count as minor faults.
    code = (
        "import resource, sys\n"
        "from gmr_traj.memory import keep_freed\n"
        "if sys.argv[1] == 'keep': assert keep_freed()\n"
        "def faults(): return resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "size = 1 << 26\n"
        "del [bytearray(size)][:]\n"
        "before = faults()\n"
        "for _ in range(10): block = bytearray(size); block[::4096] = bytes(len(block[::4096])); del block\n"
        "print(faults() - before)\n"
    )
    counts = {
        mode: int(subprocess.run([sys.executable, "-c", code, mode], capture_output=True, text=True, check=True).stdout)
        for mode in ("keep", "default")
    }
    assert counts["keep"] < 0.5 * counts["default"]
