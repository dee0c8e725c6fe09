"""The viewer's window, which nobody but this machine can reach."""

from __future__ import annotations

import os
import secrets
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from gmr_traj.exceptions import GmrTrajError

LOOPBACK = "127.0.0.1"
PATIENCE = 2.0  # a viewer that cannot start says so within this [s]


def check_screen() -> None:
    """Refuse to open a window where there is no screen.

    Raises:
        GmrTrajError: there is none.
    """
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise GmrTrajError(
            "there is no screen to open the viewer on (neither DISPLAY nor WAYLAND_DISPLAY is set); write a recording "
            "(view --output FILE.rrd, refine --rerun FILE.rrd) and open it where there is one, with gmr-traj view"
        )


def unnamed() -> Path:
    """Where a recording goes that is only to be looked at: the system's folder for such files."""
    return Path(tempfile.gettempdir()) / f"gmr-traj-{secrets.token_hex(6)}.rrd"


def show(recording: Path) -> None:
    """Open a recording in a viewer of its own, which stays when this program ends.

    Raises:
        GmrTrajError: the viewer ends at once.
    """
    process = subprocess.Popen(
        command(recording),
        env=dict(os.environ, RERUN_APP_ONLY="true"),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        _, complaint = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return
    if process.returncode:
        reason = next((line for line in reversed(complaint.splitlines()) if line.strip()), "it says no reason")
        raise GmrTrajError(f"{recording}: the rerun viewer ended at once: {reason.strip()}")


def command(recording: Path) -> list[str]:
    """The viewer's command line: bound to this machine alone, on a port that is free."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port = probe.getsockname()[1]
    viewer = [sys.executable, "-m", "rerun_cli", "--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]
    return [*viewer, str(recording.resolve())]
