"""The two orders in which a robot's bodies and joints are listed.

MuJoCo lists a kinematic tree depth first: the left leg, then the right leg, and so on.  Isaac (PhysX) lists it
breadth first: both hips, then what hangs on them.  Files name neither.
"""

from __future__ import annotations

from collections import deque

from gmr_traj.robot import Robot


def breadth_first_bodies(robot: Robot) -> tuple[str, ...]:
    """Bodies level by level, and within a level in the order of their parents, then of the model."""
    parents = robot.model.body_parentid
    children: dict[int, list[int]] = {}
    for body in range(1, robot.model.nbody):
        children.setdefault(int(parents[body]), []).append(body)
    found: list[int] = []
    queue = deque(children.get(0, []))
    while queue:
        body = queue.popleft()
        found.append(body)
        queue.extend(children.get(body, []))
    return tuple(robot.body_names[body - 1] for body in found)


def moving_bodies(robot: Robot) -> frozenset[str]:
    """The base and the bodies that a joint moves; the others are fixed to these, and importers may merge them."""
    return frozenset(robot.body_names[int(body) - 1] for body in robot.model.jnt_bodyid)


def breadth_first_joints(robot: Robot) -> tuple[str, ...]:
    """Joints in the breadth-first order of the bodies they move."""
    bodies = [robot.body_names[int(body) - 1] for body in robot.model.jnt_bodyid[1:]]
    moved = dict(zip(bodies, robot.joint_names, strict=True))
    return tuple(moved[body] for body in breadth_first_bodies(robot) if body in moved)


def leg_joints(robot: Robot) -> tuple[str, ...]:
    """Joints between the base and the soles, without which a motion says nothing about the feet."""
    found = set()
    for sole in robot.soles:
        body = robot.body_names.index(sole.body) + 1
        while body:
            found.add(body)
            body = int(robot.model.body_parentid[body])
    return tuple(
        name for name, body in zip(robot.joint_names, robot.model.jnt_bodyid[1:], strict=True) if int(body) in found
    )
