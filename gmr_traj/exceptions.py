"""Everything gmr-traj raises on purpose.

One tree, so that the command can turn any of them into one line and an exit code, and a caller can
catch exactly what it can handle.  Messages name the file, the frame or field, and what would be right.
"""

from __future__ import annotations


class GmrTrajError(Exception):
    """Base of every error that is meant for the person at the keyboard."""


class ClipError(GmrTrajError):
    """A motion file cannot be read, or its content is not a motion of this robot."""


class RobotError(GmrTrajError):
    """A robot description is missing, incomplete or contradicts its model file."""


class ProblemError(GmrTrajError):
    """A problem file names an unknown term, use or option, or a value out of range."""


class MapError(GmrTrajError):
    """A human-to-robot map is missing, incomplete, or does not fit the human motion or the robot."""


class ScheduleError(GmrTrajError):
    """A contact schedule does not fit the clip or the robot."""


class ResourceError(GmrTrajError):
    """A named model, problem or config does not exist; the message lists those that do."""


class SolverError(GmrTrajError):
    """The solver could not be run at all (not: it ran and did not converge, which is a status)."""


class DrawingError(GmrTrajError):
    """Pictures cannot be drawn here: there is no driver to draw with."""


class PolicyError(GmrTrajError):
    """A tracking policy cannot be run: its file, its shapes or its metadata are not what they should be."""


class RolloutError(GmrTrajError):
    """Rollouts cannot be run to their end here: a process that computes them was killed."""


class BatchError(GmrTrajError):
    """A batch cannot be run: its inputs, its settings, its folder or its cluster are not what they should be."""


class BenchError(GmrTrajError):
    """Something cannot be measured: what it needs is missing, or the process that measures it ended early."""
