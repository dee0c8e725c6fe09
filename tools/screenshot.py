"""Take a picture of a recording in the rerun viewer, without a screen.

    gmr-traj refine examples/punch.npz --rerun /tmp/punch.rrd
    python tools/screenshot.py /tmp/punch.rrd docs/rerun.png

It needs a graphics driver; on Debian without a graphics card that is

    apt-get install --no-install-recommends mesa-vulkan-drivers libvulkan1
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.exceptions import GmrTrajError

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient, ViewerState

#: Mesa's renderer on the processor, for machines without a graphics card (Debian: mesa-vulkan-drivers, libvulkan1).
DRIVERS = Path("/usr/share/vulkan/icd.d")
START, LOAD = 60.0, 120.0  # how long the viewer may take to start, to load a recording [s]
SETTLE = 1.5  # between what is shown and its picture [s]


@dataclass(frozen=True)
class Look:
    """A picture of a recording and what the viewer reports.

    Attributes:
        picture: the whole window, as PNG.
        views: pictures of single views by their names, as PNG.
        timeline: the timeline the recording is on.
        seconds: where the cursor is on it [s].
        reports: what views could not show, with the view's name; empty where all is well.
    """

    picture: bytes
    views: dict[str, bytes]
    timeline: str
    seconds: float
    reports: tuple[str, ...]


def software_renderer() -> Path | None:
    """Mesa's description of its software renderer, None where it is not installed."""
    return next(iter(sorted(DRIVERS.glob("lvp_icd*.json"))), None)


def look(recording: Path, seconds: float | None, size: tuple[int, int], kinds: tuple[str, ...] = ()) -> Look:
    """Show a recording without a screen.

    Args:
        recording: the .rrd file.
        seconds: time to go to [s]; None for where the recording opens.
        size: width and height of the window [points].
        kinds: classes of views to take pictures of one by one, e.g. ``3D``.

    Raises:
        GmrTrajError: the viewer does not start, or does not show the recording in time.
    """
    if not recording.is_file():
        raise GmrTrajError(f"{recording}: no such file")
    with viewer(size) as client:
        client.open(str(recording.resolve()))
        _wait_until_loaded(client, recording)
        if seconds is not None:
            client.set_time("time", duration=seconds, play_state="paused")
        client.take_screenshot()  # the first one comes before meshes and plots are on the graphics card
        time.sleep(SETTLE)
        picture = client.take_screenshot()
        state = client.get_state()
        pictures = {v.name: client.take_screenshot(v.view_id) for v in state.views if v.view_class in kinds}
        reports = tuple(
            f"{view.name}: {report.severity}: {report.summary} {report.details or ''}".strip()
            for view in state.views
            for report in view.reports
        )
        return Look(picture, pictures, *_cursor(state), reports)


@contextmanager
def viewer(size: tuple[int, int]) -> Iterator[ViewerClient]:
    """A viewer without a window that only this machine can reach; it ends with the block."""
    from rerun.experimental import ViewerClient

    port = _free_port()
    command = [sys.executable, "-m", "rerun_cli", "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", f"{size[0]}x{size[1]}", "--hide-welcome-screen"]
    variables = dict(os.environ, RERUN_APP_ONLY="true")
    driver = software_renderer()
    if driver is not None and "VK_ICD_FILENAMES" not in variables:
        variables["VK_ICD_FILENAMES"] = str(driver)
    process = subprocess.Popen(
        command, env=variables, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )
    try:
        _wait_for(port, process)
        yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    finally:
        _end(process)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait_for(port: int, process: subprocess.Popen[str]) -> None:
    """Wait until the viewer listens.

    Raises:
        GmrTrajError: it ended, or does not listen in time.
    """
    end = time.monotonic() + START
    while time.monotonic() < end:
        if process.poll() is not None:
            raise GmrTrajError(
                f"the rerun viewer ended with code {process.returncode}; it needs a graphics driver (on Debian: "
                "apt-get install --no-install-recommends mesa-vulkan-drivers libvulkan1)"
            )
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise GmrTrajError(f"the rerun viewer does not answer within {START:.0f} s")


def _wait_until_loaded(client: ViewerClient, recording: Path) -> None:
    """Wait until a recording is whole and its views are there.

    Raises:
        GmrTrajError: it is not in time.
    """
    end = time.monotonic() + LOAD
    while time.monotonic() < end:
        state = client.get_state()
        if state.active_recording and not state.loading and state.views:
            return
        time.sleep(0.2)
    raise GmrTrajError(f"{recording}: the rerun viewer does not show it within {LOAD:.0f} s")


def _cursor(state: ViewerState) -> tuple[str, float]:
    """The timeline of the active recording, and where the cursor is on it [s].

    Raises:
        GmrTrajError: it is nowhere.
    """
    for recording in state.recordings:
        if (
            recording.store_id == state.active_recording
            and recording.current_timeline
            and recording.current_time is not None
        ):
            return recording.current_timeline, recording.current_time / 1e9
    raise GmrTrajError("the rerun viewer is on no timeline of the recording")


def _end(process: subprocess.Popen[str]) -> None:
    """End the viewer and the Python process that started it: they are a process group of their own."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def main() -> int:
    """Read the arguments, take the picture, print what views complain about."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="an .rrd file of gmr-traj")
    parser.add_argument("picture", type=Path, help="PNG to write")
    parser.add_argument("--time", type=float, help="time to go to [s] (default: where the recording opens)")
    parser.add_argument("--size", type=int, nargs=2, default=(1920, 1200), help="of the window (default: 1920 1200)")
    arguments = parser.parse_args()
    try:
        seen = look(arguments.recording, arguments.time, tuple(arguments.size))
    except GmrTrajError as error:
        print(f"screenshot.py: error: {error}", file=sys.stderr)
        return 2
    arguments.picture.write_bytes(seen.picture)
    print(f"{arguments.picture}: {seen.timeline} at {seen.seconds:.3f} s; {len(seen.reports)} reports")
    for report in seen.reports:
        print(report, file=sys.stderr)
    return 1 if seen.reports else 0


if __name__ == "__main__":
    sys.exit(main())
