"""Units of a file: radians or degrees, metres or centimetres, quaternions of unit length, Z up."""

from __future__ import annotations

import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.robot import Robot

_SLACK = 1.0  # no robot is this far beyond its joint range [rad] in more than a few frames
_MANY = 0.2  # share of frames that is more than a few
_LENGTHS = (0.9, 1.1)  # lengths of quaternions that were interpolated or smoothed component by component


def unit_quaternions(quaternion: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Quaternions of unit length.

    Args:
        quaternion: in any order.  # (T, 4)

    Returns:
        The quaternions, and a note where some were visibly longer or shorter.

    Raises:
        ClipError: a length is too far from 1 for a quaternion.
    """
    length = np.linalg.norm(quaternion, axis=1)
    low, high = _LENGTHS
    off = np.flatnonzero((length < low) | (length > high))
    if off.size:
        raise ClipError(
            f"frame {off[0]}: the base quaternion has length {length[off[0]]:.4f}, not 1 ({off.size} such frames); "
            "these columns are not a quaternion: is the format another?"
        )
    rough = np.abs(length - 1.0) > 1e-3
    notes: tuple[str, ...] = ()
    if rough.any():
        worst = length[np.abs(length - 1.0).argmax()]
        notes = (f"base quaternions scaled to unit length: {rough.sum()} frames had another (farthest {worst:.3f})",)
    return quaternion / length[:, None], notes


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """The same orientations without a change of sign from one frame to the next."""
    products = np.sum(quaternions[1:] * quaternions[:-1], axis=-1)
    signs = np.cumprod(np.where(products < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., None]])


def radians(joints: np.ndarray, robot: Robot) -> tuple[np.ndarray, tuple[str, ...]]:
    """Joint positions in radians, converted where they can only be degrees.

    Args:
        joints: joint positions as in the file.  # (T, n)
        robot: robot with these joints.

    Returns:
        Joint positions [rad], and a note where they were degrees.

    Raises:
        ClipError: they are far outside the joints' ranges either way, as in another order of joints or another robot.
    """
    excess = _excess(joints, robot)
    share = float((excess > _SLACK).any(axis=1).mean())
    if share <= _MANY:
        return joints, ()
    converted = np.radians(joints)
    outside = float((_excess(converted, robot) > _SLACK).any(axis=1).mean())
    if outside <= _MANY and np.abs(joints).max() > 2 * np.pi:
        return converted, ("joint positions are degrees, as radians they leave the joints' ranges; written in radians",)
    worst = int(excess.max(axis=0).argmax())
    raise ClipError(
        f"joint {robot.joint_names[worst]} is up to {excess[:, worst].max():.1f} rad outside its range, and in "
        f"{share:.0%} of the frames a joint is more than {_SLACK:g} rad outside: is this another order of joints, or "
        "another robot?"
    )


def metres(position: np.ndarray, robot: Robot) -> tuple[np.ndarray, tuple[str, ...]]:
    """Base positions in metres, converted where they can only be centimetres.

    Args:
        position: base positions as in the file.  # (T, 3)
        robot: robot whose standing height decides.

    Returns:
        Base positions [m], and a note where they were centimetres.
    """
    standing = float(robot.nominal[2])
    ratio = float(np.median(position[:, 2])) / standing
    # A base at 30 to 200 times its standing height is a crouch to a leap in centimetres.
    if 30.0 < ratio < 200.0:
        height = f"a height of {ratio * standing:.0f} is {ratio:.0f} times standing"
        note = f"base positions are centimetres: {height}; written in metres"
        return position / 100.0, (note,)
    return position, ()


def check_z_up(position: np.ndarray, up: np.ndarray, robot: Robot) -> None:
    """Refuse a clip whose vertical axis is Y.

    Args:
        position: base positions [m].  # (T, 3)
        up: the base's own up axis in the world.  # (T, 3)
        robot: robot whose standing height decides.

    Raises:
        ClipError: the base stands along Y, and its Y is a standing height.
    """
    standing = float(robot.nominal[2])
    along = np.median(up, axis=0)
    height = float(np.median(position[:, 1]))
    if along[1] > 0.7 > 0.5 > along[2] and 0.6 * standing < height < 1.5 * standing:
        raise ClipError("the robot stands along Y: the clip is Y-up; rotate it by 90 degrees about X so that Z is up")


def _excess(joints: np.ndarray, robot: Robot) -> np.ndarray:
    """How far each joint is outside its range [rad], 0 inside."""
    return np.maximum(np.maximum(joints - robot.position_upper, robot.position_lower - joints), 0.0)
