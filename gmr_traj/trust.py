"""How far each frame of a clip can be believed."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.spatial.transform import Rotation

from gmr_traj.motion import RobotMotion

# Accelerations that hardly any human motion asks of a robot; what lies above is taken for a fault.
PLAUSIBLE_JOINT = 150.0  # [rad/s^2]
PLAUSIBLE_BASE = 60.0  # [m/s^2]
PLAUSIBLE_TURN = 150.0  # [rad/s^2]
# A fault spoils the frames around it [s].
REACH = 0.08
# Accelerations above plausible, as a share of it, from which on a frame is at fault; and is where the clip jumps.
FAULT, JUMP = 0.5, 10.0
# Frames at either end that a jump separates from the rest are part of the fault if there are at most this many [s].
END = 0.25
# Trust left to frames that are known to be wrong: enough to keep the problem well posed.
NONE = 1e-4


def trust(motion: RobotMotion) -> np.ndarray:
    """``1 / (1 + e^2)`` near an acceleration e times above plausible, else 1; almost 0 for spoiled ends.  # (T,)

    Frame-by-frame retargeting starts from some posture of its own and takes a few frames to reach the motion; those
    frames say nothing.  The faults that a clip begins with, one right after the other, and whatever lies outside of a
    jump near one of its ends, are distrusted altogether, so that smoothness continues the motion into them.  Other
    faults near the ends are as any: a clip that was cut in the middle of a fast motion ends in frames that say much.
    """
    frames = motion.frames
    if frames < 3:
        return np.ones(frames)
    excess = np.maximum(0.0, _acceleration_ratio(motion) - 1.0)
    reach = max(1, round(REACH * motion.fps))
    out = 1.0 / (1.0 + maximum_filter1d(excess, 2 * reach + 1) ** 2)
    end = min(round(END * motion.fps), frames // 4)
    jumps = np.flatnonzero(excess > JUMP)
    before = [_transient(excess[: end + 1], reach), *(jumps[jumps <= end] + 1).tolist()]
    after = [frames, *jumps[jumps >= frames - 1 - end].tolist()]
    out[: max(before)] = out[min(after) :] = NONE
    return np.asarray(out)


def _transient(excess: np.ndarray, reach: int) -> int:
    """How many frames the faults take that a clip begins with, none farther than ``reach`` from the one before."""
    last = -1
    for t in np.flatnonzero(excess > FAULT).tolist():
        if t > (last + reach if last >= 0 else 0):
            break
        last = t
    return last + 1


def without_spoiled_ends(motion: RobotMotion, believed: np.ndarray) -> RobotMotion:
    """The first and the last frame that are believed, instead of those before and after.

    Args:
        motion: a clip.
        believed: frames that say something about the motion.  # (T,) bool
    """
    if believed.all() or not believed.any():
        return motion
    first, last = int(np.argmax(believed)), motion.frames - 1 - int(np.argmax(believed[::-1]))
    return motion.with_qpos(motion.qpos[np.clip(np.arange(motion.frames), first, last)])


def _acceleration_ratio(motion: RobotMotion) -> np.ndarray:
    """Largest acceleration of a frame as a share of what is plausible.  # (T,)"""
    qpos, fps = motion.qpos, motion.fps
    joints = np.abs(np.diff(qpos[:, 7:], 2, axis=0)).max(axis=1, initial=0.0) * fps**2 / PLAUSIBLE_JOINT
    base = np.linalg.norm(np.diff(qpos[:, :3], 2, axis=0), axis=1) * fps**2 / PLAUSIBLE_BASE
    rotation = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    turn = np.linalg.norm(np.diff((rotation[1:] * rotation[:-1].inv()).as_rotvec(), axis=0), axis=1) * fps**2
    inner = np.maximum(np.maximum(joints, base), turn / PLAUSIBLE_TURN)
    return np.concatenate([inner[:1], inner, inner[-1:]])
