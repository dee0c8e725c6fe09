"""Limbs: the branches that hang off a robot's trunk, and where their capsules are for given joint angles.

The trunk is the chain from the base to the anchor body (pelvis to torso). Every branch off it is a limb, whatever the
robot calls it. All placements here are in the frame of the trunk body the limb hangs off, its *root*.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from gmr_traj.collision.segments import Array
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class Limb:
    """One branch of the tree.

    Attributes:
        robot: the robot it belongs to.
        bodies: its bodies as indices into ``robot.body_names``, parents first.  # nb
        root: the trunk's body it hangs off, likewise.
    """

    robot: Robot
    bodies: tuple[int, ...]
    root: int

    @cached_property
    def joints(self) -> np.ndarray:
        """Indices of its joints into ``qpos[:, 7:]``, in the order of the bodies that they move.  # (k,)"""
        model = self.robot.model
        addresses = [int(model.jnt_qposadr[int(model.body_jntadr[b + 1])]) - 7 for b in self._moved]
        return np.array(addresses, dtype=np.intp)

    @cached_property
    def capsules(self) -> tuple[int, ...]:
        """Its capsules, indices into ``robot.capsules``.  # C"""
        names = {self.robot.body_names[b] for b in self.bodies}
        return tuple(c for c, capsule in enumerate(self.robot.capsules) if capsule.body in names)

    @cached_property
    def feet(self) -> bool:
        """Whether it carries a sole."""
        names = {self.robot.body_names[b] for b in self.bodies}
        return any(sole.body in names for sole in self.robot.soles)

    @cached_property
    def _moved(self) -> list[int]:
        return [b for b in self.bodies if int(self.robot.model.body_jntnum[b + 1])]

    @cached_property
    def _moves(self) -> Array:
        """Which joint moves which capsule.  # (C, k)"""
        model, names = self.robot.model, self.robot.body_names
        out = np.zeros((len(self.capsules), len(self._moved)))
        for row, c in enumerate(self.capsules):
            body = names.index(self.robot.capsules[c].body)
            while body != self.root:
                if body in self._moved:
                    out[row, self._moved.index(body)] = 1.0
                body = int(model.body_parentid[body + 1]) - 1
        return out

    def ends(self, angles: Array) -> tuple[Array, Array, Array]:
        """End points of its capsules and the joints' lines, in the root's frame.

        Args:
            angles: of ``joints`` [rad].  # (N, k)

        Returns:
            points [m], the joints' anchors [m] and unit axes.  # (N, C, 2, 3), (N, k, 3), (N, k, 3)
        """
        model, count = self.robot.model, len(angles)
        where = {self.root: (np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3)))}
        anchors, axes = np.empty((2, count, len(self._moved), 3))
        for body in self.bodies:
            position, rotation = where[int(model.body_parentid[body + 1]) - 1]
            position = position + rotation @ model.body_pos[body + 1]
            rotation = rotation @ _matrix(model.body_quat[body + 1])
            if body in self._moved:
                k = self._moved.index(body)
                joint = int(model.body_jntadr[body + 1])
                axis, offset = np.asarray(model.jnt_axis[joint]), np.asarray(model.jnt_pos[joint])
                anchors[:, k], axes[:, k] = position + rotation @ offset, rotation @ axis
                zero = float(model.qpos0[int(model.jnt_qposadr[joint])])
                rotation = rotation @ _turns(axis, angles[:, k] - zero)
                position = anchors[:, k] - rotation @ offset
            where[body] = (position, rotation)
        points = np.empty((count, len(self.capsules), 2, 3))
        for row, c in enumerate(self.capsules):
            capsule = self.robot.capsules[c]
            position, rotation = where[self.robot.body_names.index(capsule.body)]
            points[:, row, 0] = position + rotation @ capsule.start
            points[:, row, 1] = position + rotation @ capsule.end
        return points, anchors, axes

    def jacobian(self, points: Array, anchors: Array, axes: Array) -> Array:
        """Derivatives of the end points by the joints: ``a_k x (p - o_k)``.  # (N, C, 2, k, 3)"""
        arms = points[:, :, :, None, :] - anchors[:, None, None]
        turned = np.cross(np.broadcast_to(axes[:, None, None], arms.shape), arms)
        return np.asarray(turned * self._moves[None, :, None, :, None])


def limbs(robot: Robot) -> list[Limb]:
    """All branches off the trunk."""
    model, names = robot.model, robot.body_names
    parent = [int(model.body_parentid[b + 1]) - 1 for b in range(len(names))]
    trunk = [names.index(robot.anchor_body)]
    while trunk[-1] > 0:
        trunk.append(parent[trunk[-1]])
    out = []
    for first in range(len(names)):
        if first in trunk or parent[first] not in trunk:
            continue
        bodies = [first]
        bodies += [b for b in range(first + 1, len(names)) if _hangs_off(parent, b, first)]
        out.append(Limb(robot, tuple(bodies), parent[first]))
    return [limb for limb in out if limb.joints.size]


def _hangs_off(parent: Sequence[int], body: int, first: int) -> bool:
    while body > first:
        body = parent[body]
    return body == first


def _matrix(quaternion: Array) -> Array:
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, np.asarray(quaternion, dtype=float))
    return out.reshape(3, 3)


def _turns(axis: Array, angles: Array) -> Array:
    """Rotations about one unit axis: ``I + sin(a) K + (1 - cos(a)) K^2``.  # (N, 3, 3)"""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sine * k + (1.0 - cosine) * (k @ k))
