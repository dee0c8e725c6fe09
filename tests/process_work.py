"""Work for fresh processes; on its own, because each of them imports it."""

import os
import signal
import time


def reciprocal(seconds: float) -> float:
    """One over the seconds, after as many; ends its process where they are negative."""
    if seconds < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(seconds)
    return 1.0 / seconds
