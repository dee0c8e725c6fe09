"""The two-stage inverse kinematics of one frame, and of a clip frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.inverse_kinematics import InverseKinematics
from gmr_traj.retarget.joint_ranges import joint_limits
from gmr_traj.retarget.options import Options
from gmr_traj.robot import Robot
from gmr_traj.toml_table import Table

_UNBOUNDED = 1e30  # what daqp takes for infinity
_REPORT_EVERY = 20  # frames between two reports of progress


@dataclass(frozen=True)
class StepSettings:
    """Numbers of the iteration in one stage, read from a method's file.

    Attributes:
        max_steps: most steps a stage takes.
        tolerance: a stage ends when its value changes by less.
        damping, lm_damping: see ``InverseKinematics``.
        limit_gain: share of the distance to a joint limit that one step may close.
    """

    max_steps: int
    tolerance: float
    damping: float
    lm_damping: float
    limit_gain: float

    @classmethod
    def read(cls, table: Table) -> StepSettings:
        """Read them from their table.

        Raises:
            GmrTrajError: a field is missing or out of range.
        """
        settings = cls(
            max_steps=table.count("max_steps", 0),
            tolerance=table.number("tolerance", above=0.0),
            damping=table.number("damping", above=0.0),
            lm_damping=table.weight("lm_damping"),
            limit_gain=table.number("limit_gain", above=0.0),
        )
        if settings.max_steps < 1:
            raise table.error("max_steps must be at least 1")
        if settings.limit_gain > 1.0:
            raise table.error(f"limit_gain is {settings.limit_gain:g}; above 1 a step would cross the limit")
        return settings


class FrameSolver:
    """Two stages, one after the other, from a start towards the targets of one frame.

    Joint limits hold in every step.  Where a velocity limit is wanted, so do ``|q_t - q_(t-1)| <= factor v_max / fps``:
    bounds that belong to the frame and not to its steps, however many there are.

    Args:
        robot: the robot.
        body_map: bodies, costs, joint ranges.
        targets: placements of the map's bodies in all frames.
        fps: frames per second [Hz].
        settings: the numbers.
        options: the velocity limit, the callback.
        value: what is watched for a change: a number of the bodies' squared errors and the stage's squared costs,
            (linear, angular).  # (B, 2) each
        ended: whether a stage ends, of the value before a step, the value after it, and the tolerance.
    """

    def __init__(
        self,
        robot: Robot,
        body_map: BodyMap,
        targets: BodyTargets,
        fps: float,
        settings: StepSettings,
        options: Options,
        *,
        value: Callable[[np.ndarray, np.ndarray], float],
        ended: Callable[[float, float, float], bool],
    ) -> None:
        self.robot, self.targets, self.settings = robot, targets, settings
        self.steps = 0
        self.lower, self.upper = joint_limits(robot, body_map.joint_ranges)
        self._options, self._value, self._ended = options, value, ended
        costs = [body_map.costs(stage) for stage in (1, 2)]
        self._squared_costs = [np.square(stage) for stage in costs]
        self._ik = InverseKinematics(
            robot, body_map.bodies, body_map.points, costs, damping=settings.damping, lm_damping=settings.lm_damping
        )
        factor = options.velocity_limit
        self._reach = None if factor is None else factor * robot.velocity_limit / fps
        self._step_lower = np.full(robot.model.nv, -_UNBOUNDED)
        self._step_upper = np.full(robot.model.nv, _UNBOUNDED)

    def frame(self, t: int, q: np.ndarray, last: np.ndarray | None = None) -> np.ndarray:
        """The configuration of frame ``t``.

        Args:
            t: the frame.
            q: where to start, within the joint limits.  # (7 + n,)
            last: the configuration of the frame before, for the velocity limit; None for no such limit.  # (7 + n,)

        Raises:
            SolverError: a quadratic program was not solved.
        """
        ik = self._ik
        ik.aim(self.targets.positions[t], self.targets.quaternions[t])
        ik.place(q)
        for stage, costs in enumerate(self._squared_costs):
            value = self._value(ik.squares, costs)
            for _ in range(self.settings.max_steps):
                self._bound(q, last)
                q = ik.step(stage, self._step_lower, self._step_upper)
                self.steps += 1
                ik.place(q)
                before, value = value, self._value(ik.squares, costs)
                if self._ended(before, value, self.settings.tolerance):
                    break
        return q

    def clip(self, q: np.ndarray) -> np.ndarray:
        """All frames, each from where the last one ended.

        Args:
            q: where the first frame starts.  # (7 + n,)

        Returns:
            Configurations.  # (T, 7 + n)
        """
        frames = self.targets.frames
        out = np.empty((frames, len(q)))
        for t in range(frames):
            out[t] = q = self.frame(t, q, out[t - 1] if t else None)
            if self._options.progress is not None and (t % _REPORT_EVERY == 0 or t == frames - 1):
                self._options.progress("retargeting", t + 1, frames)
        return out

    def _bound(self, q: np.ndarray, last: np.ndarray | None) -> None:
        """Bounds of the joints' next step, from the configuration q."""
        gain, joints, lower, upper = self.settings.limit_gain, q[7:], self._step_lower[6:], self._step_upper[6:]
        np.subtract(self.lower, joints, out=lower)
        np.subtract(self.upper, joints, out=upper)
        if gain != 1.0:
            lower *= gain
            upper *= gain
        if last is not None and self._reach is not None:
            moved = joints - last[7:]
            # The first step of a frame starts at the last frame, so zero is within: the bounds never contradict.
            np.maximum(lower, np.minimum(-self._reach - moved, 0.0), out=lower)
            np.minimum(upper, np.maximum(self._reach - moved, 0.0), out=upper)
