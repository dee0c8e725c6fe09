"""From what a file says to a motion of the robot: units, orders and frame rate, tested and noted."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule_json import from_json
from gmr_traj.exceptions import ClipError
from gmr_traj.formats.clip import Clip
from gmr_traj.formats.raw import RawMotion, number
from gmr_traj.formats.standing import CONTRADICTING, DECISIVE, ON_ITS_FEET, StandingTest
from gmr_traj.formats.tree_order import breadth_first_joints, leg_joints
from gmr_traj.formats.units import check_z_up, metres, radians, unit_quaternions
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import reduce_robot

QUATERNION_ORDERS = ("xyzw", "wxyz")
_FORMAT_OF_ORDER = {"xyzw": "unitree-csv", "wxyz": "protomotions-csv"}
_SLOWEST, _FASTEST = 1.0, 1000.0  # frames per second
_FAR_FROM_FLOOR = 0.2  # [m]; the recorded clip that floats most does so by 0.14


def reduced(robot: Robot, joint_names: tuple[str, ...]) -> Robot:
    """The robot with these joints alone; itself where they are all it has."""
    return robot if set(joint_names) == set(robot.joint_names) else reduce_robot(robot, joint_names)


def joint_sets(robot: Robot) -> tuple[tuple[str, ...], ...]:
    """The joints a file without joint names can hold, in the model's order.

    Either all, or all but the wrists: the 23 of the G1 that trackers without hands use.
    """
    arms = tuple(name for name in robot.joint_names if "wrist" not in name)
    return (robot.joint_names,) if len(arms) == robot.dof else (robot.joint_names, arms)


def joints_of(robot: Robot, count: int) -> tuple[str, ...]:
    """The joints a file with ``count`` joints holds, in the model's order.

    Raises:
        ClipError: ``count`` is that of no set of joints.
    """
    sets = joint_sets(robot)
    for names in sets:
        if count == len(names):
            return names
    expected = " or ".join(str(len(names)) for names in sets)
    raise ClipError(
        f"the file has {count} joints, {robot.name} has {expected}: is this another robot (--robot) or --format?"
    )


def decide(raw: RawMotion, robot: Robot, *, fps: float | None, quaternion: str | None) -> Clip:
    """Test what a file says and make a clip of it.

    Args:
        raw: what the file says.
        robot: the robot it should be a motion of.
        fps: frame rate to use instead of the file's [Hz].
        quaternion: quaternion order to use instead of the format's (``xyzw`` or ``wxyz``).

    Raises:
        ClipError: it is not a motion of this robot, or a question stays open; the message names the flag to set.
        ScheduleError: its contact schedule does not fit.
    """
    if raw.robot and raw.robot != robot.name:
        raise ClipError(f"the clip is of robot {raw.robot!r}, not {robot.name!r}; set --robot")
    names, joints, model = _joints(raw, robot)
    rate, notes = _rate(raw, fps)
    joints, joint_notes = radians(joints, model)
    position, position_notes = metres(raw.position, model)
    turns, turn_notes = unit_quaternions(raw.quaternion)
    notes = (*raw.notes, *notes, *joint_notes, *position_notes, *turn_notes)
    standing = StandingTest(model, joints, rate)
    order, order_notes = _order(raw, position, turns, standing, quaternion)
    turns = np.roll(turns, 1, axis=1) if order == "xyzw" else turns
    check_z_up(position, Rotation.from_quat(turns, scalar_first=True).as_matrix()[:, :, 2], model)
    if raw.joint_names is None and not raw.confirmed:
        _check_joint_order(joints, position, turns, model, standing, rate)
    above = standing.lowest_sole(position, turns)
    if abs(above) > _FAR_FROM_FLOOR:
        notes = (
            *notes,
            f"the lowest sole is {abs(above):.2f} m {'above' if above > 0 else 'below'} the floor (median)",
        )
    motion = RobotMotion(np.concatenate([position, turns, joints], axis=1), rate, names, robot.name)
    schedule = None
    if raw.contacts is not None:
        schedule = from_json(raw.contacts, robot, frames=motion.frames, fps=motion.fps)
    name = _FORMAT_OF_ORDER[order] if raw.format == "csv" else raw.format
    extras = {**raw.extras, "quaternion": order, "further": raw.further}
    if raw.further:
        order_notes = (*order_notes, f"kept beside the motion, and written back unchanged: {', '.join(raw.further)}")
    return Clip(motion, name, schedule, raw.references, extras, (*notes, *order_notes))


def _joints(raw: RawMotion, robot: Robot) -> tuple[tuple[str, ...], np.ndarray, Robot]:
    """Names in the model's order, the columns in that order, and the robot with these joints."""
    if raw.joint_names is None:
        names = joints_of(robot, raw.joints.shape[1])
        return names, raw.joints, reduced(robot, names)
    if len(raw.joint_names) != raw.joints.shape[1]:
        raise ClipError(f"the file names {len(raw.joint_names)} joints but has {raw.joints.shape[1]} columns of them")
    unknown = [name for name in raw.joint_names if name not in robot.joint_names]
    if unknown:
        raise ClipError(f"{robot.name} has no joint {unknown[0]!r}; it has {', '.join(robot.joint_names)}")
    absent = [name for name in leg_joints(robot) if name not in raw.joint_names]
    if absent:
        raise ClipError(
            f"the file has no joint {absent[0]!r}; of {robot.name}'s joints it may leave out the upper body's"
        )
    names = tuple(name for name in robot.joint_names if name in raw.joint_names)
    columns = [raw.joint_names.index(name) for name in names]
    return names, raw.joints[:, columns], reduced(robot, names)


def _rate(raw: RawMotion, fps: float | None) -> tuple[float, tuple[str, ...]]:
    notes: tuple[str, ...] = ()
    if fps is not None:
        rate, notes = float(fps), (f"frame rate {fps:g} Hz, as asked",)
    elif raw.fps is not None:
        rate = number(raw.fps, "fps")
    elif raw.default_fps is not None:
        rate = raw.default_fps
        notes = (f"frame rate {rate:g} Hz by convention, the file does not say; --fps sets another",)
    else:
        raise ClipError("the file does not say its frame rate; set --fps")
    if not _SLOWEST <= rate <= _FASTEST:
        hint = " (is it the time of a frame?)" if 0 < rate < _SLOWEST else ""
        raise ClipError(f"the frame rate is {rate:g} Hz{hint}; expected {_SLOWEST:g} to {_FASTEST:g}: set --fps")
    return rate, notes


def _order(
    raw: RawMotion, position: np.ndarray, turns: np.ndarray, standing: StandingTest, asked: str | None
) -> tuple[str, tuple[str, ...]]:
    """Quaternion order: as asked, as the format defines and the clip bears out, or by how the robot stands."""
    if raw.confirmed and raw.order is not None:
        return raw.order, ()
    if asked is not None:
        return asked, (f"quaternion order {asked}, as asked",)
    odd = {
        "wxyz": standing.oddness(position, turns),
        "xyzw": standing.oddness(position, np.roll(turns, 1, axis=1)),
    }
    likely, other = sorted(odd, key=lambda order: odd[order])
    gap = odd[other] - odd[likely]
    figures = f"base tilt, sole tilt and foot slip score {odd[likely]:.1f} read so, {odd[other]:.1f} read as {other}"
    if raw.order is None:
        if gap < DECISIVE:
            raise ClipError(
                "the quaternion order cannot be told, the robot stands about as well either way: as "
                f"{likely} {figures}; set --quaternion xyzw or --quaternion wxyz"
            )
        return likely, (f"quaternion order {likely}: {figures}",)
    if likely != raw.order and gap > CONTRADICTING and odd[likely] < ON_ITS_FEET:
        raise ClipError(
            f"the base quaternion should be {raw.order} in this format but looks like {likely}: {figures}; "
            f"set --quaternion {likely}, or --quaternion {raw.order} to insist"
        )
    return raw.order, ()


def _check_joint_order(
    joints: np.ndarray, position: np.ndarray, turns: np.ndarray, model: Robot, standing: StandingTest, rate: float
) -> None:
    """Columns without names: doubt MuJoCo's order where Isaac's stands clearly better."""
    isaac = breadth_first_joints(model)
    if isaac == model.joint_names:
        return
    swapped = StandingTest(model, joints[:, [isaac.index(name) for name in model.joint_names]], rate)
    here, there = standing.oddness(position, turns), swapped.oddness(position, turns)
    if here - there > CONTRADICTING and there < ON_ITS_FEET:
        raise ClipError(
            f"the joints look like Isaac's (breadth-first) order: sole tilt and foot slip score {there:.1f} read so, "
            f"{here:.1f} in the model's order; reorder the columns, or save an npz with qpos, fps and joint_names"
        )
