"""How a run ends: Ctrl-C that foreign code swallows, and processes that must not outlive their parent.

CasADi checks for signals while Ipopt runs; on Ctrl-C it drops the `KeyboardInterrupt`, and Ipopt returns as if it had
failed (`NonIpopt_Exception_Thrown`).  Without this, an interrupted solve would be reported as one that failed.
"""

from __future__ import annotations

import ctypes
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_PR_SET_PDEATHSIG = 1


@contextmanager
def passed_on() -> Iterator[None]:
    """Raise `KeyboardInterrupt` at the end of the block where Ctrl-C was pressed in it and swallowed or disguised.

    Outside the main thread, where Python delivers no signals, the block runs as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed = False

    def handle(signum: int, frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, handle)
    try:
        yield
    except Exception as error:
        if pressed:  # some CasADi and Python versions turn it into a SystemError
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


class Stop:
    """Whether somebody has asked to stop."""

    def __init__(self) -> None:
        self.asked = False


@contextmanager
def asked_to_stop() -> Iterator[Stop]:
    """Take Ctrl-C and SIGTERM in the block as a wish to stop, which the block looks for where it can stop."""
    stop = Stop()

    def handle(signum: int, frame: FrameType | None) -> None:
        stop.asked = True

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def end_with(parent: int) -> None:
    """Let this process be killed when its parent ends, however that ends (Linux)."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before that was set
        os._exit(1)
