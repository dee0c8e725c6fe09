"""How large a motion file may be, so that no file, however made, can take the machine's memory."""

from __future__ import annotations

from gmr_traj.exceptions import ClipError

# An hour at 50 Hz of 60 bodies with positions, orientations and velocities in float64 is 1.1e9 bytes.
MAX_BYTES = 2**30


def check_size(size: int, what: str) -> None:
    """Refuse content that is, or claims to be, larger than any clip.

    Raises:
        ClipError: ``size`` [bytes] is above ``MAX_BYTES``.
    """
    if size > MAX_BYTES:
        raise ClipError(
            f"{what} takes {size / 2**20:.0f} MiB; a clip takes at most {MAX_BYTES // 2**20} MiB: cut it into parts"
        )
