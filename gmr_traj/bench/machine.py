"""The machine that was measured on, and the versions of what was."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from gmr_traj.batch.fingerprint import versions
from gmr_traj.c_compiler import compiler
from gmr_traj.kernels.library import description
from gmr_traj.threads import threads


def machine() -> dict[str, Any]:
    """Processor, cores that may be used, memory [GB], system, C compiler if any, and what the inner loops run on."""
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)
    return {
        "processor": _processor(),
        "cores": len(cores),
        "memory_gigabytes": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "system": platform.platform(),
        "compiler": compiler(),
        "kernels": description(),
        "threads": threads(),
    }


def measured_versions() -> dict[str, str]:
    """Versions of gmr-traj, Python and the packages that compute, mink where it is installed."""
    found = versions()
    try:
        found["mink"] = metadata.version("mink")
    except metadata.PackageNotFoundError:
        pass
    return found


def _processor() -> str:
    """The processor's name, as Linux knows it."""
    information = Path("/proc/cpuinfo")
    if information.is_file():
        for line in information.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
