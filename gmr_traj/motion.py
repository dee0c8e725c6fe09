"""A robot motion: configurations of one robot at a constant frame rate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.exceptions import ClipError


@dataclass(frozen=True)
class RobotMotion:
    """Configurations of a floating-base robot, one a frame.

    A configuration is ``q = (x, y, z, qw, qx, qy, qz, joints)``: base position [m] in the world (Z up),
    unit quaternion **wxyz** of the base in the world, joint positions [rad] in the order of
    ``joint_names``.

    Attributes:
        qpos: configurations, read-only float64.  # (T, 7 + n)
        fps: frames per second [Hz].
        joint_names: names of the joints, in the order of ``qpos[:, 7:]``.  # n
        robot: name of the robot the joints belong to.

    Raises:
        ClipError: on a wrong shape, no frames, a value that is not finite, a quaternion that is not of
            unit length (to 1e-3; closer ones are normalised), or a frame rate that is not positive.
    """

    qpos: np.ndarray
    fps: float
    joint_names: tuple[str, ...]
    robot: str = ""

    def __post_init__(self) -> None:
        qpos = np.array(self.qpos, dtype=np.float64)
        width = 7 + len(self.joint_names)
        if qpos.ndim != 2 or qpos.shape[1] != width:
            raise ClipError(
                f"configurations have shape {qpos.shape}; expected (frames, {width}): 7 of the base, {width - 7} joints"
            )
        if len(qpos) == 0:
            raise ClipError("the clip has no frames")
        if not np.isfinite(self.fps) or self.fps <= 0:
            raise ClipError(f"the frame rate is {self.fps}; it must be a positive number of frames per second")
        bad = np.flatnonzero(~np.isfinite(qpos).all(axis=1))
        if bad.size:
            raise ClipError(f"frame {bad[0]} has values that are not finite ({bad.size} such frames)")
        norm = np.linalg.norm(qpos[:, 3:7], axis=1)
        off = np.flatnonzero(np.abs(norm - 1.0) > 1e-3)
        if off.size:
            length = norm[off[0]]
            raise ClipError(f"frame {off[0]}: the base quaternion has length {length:.4f}, not 1 ({off.size} frames)")
        qpos[:, 3:7] /= norm[:, None]
        qpos.setflags(write=False)
        object.__setattr__(self, "qpos", qpos)
        object.__setattr__(self, "fps", float(self.fps))
        object.__setattr__(self, "joint_names", tuple(self.joint_names))

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.qpos)

    @property
    def duration(self) -> float:
        """Length of the clip [s]: frames divided by frame rate."""
        return self.frames / self.fps

    def with_qpos(self, qpos: np.ndarray) -> RobotMotion:
        """The same robot, joints and frame rate with other configurations."""
        return replace(self, qpos=qpos)

    def shifted(self, height: float) -> RobotMotion:
        """The whole clip raised by ``height`` [m]."""
        qpos = self.qpos.copy()
        qpos[:, 2] += height
        return self.with_qpos(qpos)
