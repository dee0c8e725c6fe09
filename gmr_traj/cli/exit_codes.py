"""What the command's exit codes mean."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of `gmr-traj`; the README and `--help` list the same."""

    OK = 0
    INTERNAL_ERROR = 1
    BAD_INPUT = 2
    BROKEN_PROMISE = 3
    NOT_CONVERGED = 4
    NOT_FOLLOWED = 5
    CLIP_FAILED = 6
    INTERRUPTED = 130

    @property
    def meaning(self) -> str:
        """One line for people."""
        return _MEANINGS[self]


_MEANINGS = {
    ExitCode.OK: "every promise holds (refine); every clip passes (verify); the report was made (others)",
    ExitCode.INTERNAL_ERROR: "a fault in gmr-traj itself; --traceback shows where",
    ExitCode.BAD_INPUT: "bad usage, or a file that cannot be read or written; nothing was written",
    ExitCode.BROKEN_PROMISE: "the clip was written, but a promise of its certificate is broken",
    ExitCode.NOT_CONVERGED: "the solver did not converge; its last iterate is in <output>.unconverged.<suffix>",
    ExitCode.NOT_FOLLOWED: "a clip asks for what the robot cannot do, or a rollout fell (verify)",
    ExitCode.CLIP_FAILED: "a clip failed or was not reached, the others are done; its record says why (batch)",
    ExitCode.INTERRUPTED: "interrupted from the keyboard; nothing was written (batch: what was done stays)",
}


def table() -> str:
    """All codes with their meanings, one a line."""
    return "\n".join(f"{code.value:>5}  {code.meaning}" for code in ExitCode)
