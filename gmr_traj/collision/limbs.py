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

from gmr_traj.collision.segments import Array, cross
from gmr_traj.robot import Robot


@dataclass(frozen=True)
class _Link:
    """A body of a limb in numbers.

    Attributes:
        body, parent: indices into ``robot.body_names``.
        position, rotation: of the body in its parent's frame [m].  # (3,), (3, 3)
        joint: which of the limb's joints moves it, None where none does.
        zero: the joint's angle at which the body is placed like that [rad].
        axis, offset: of the joint in the body's frame; a point on its line [m].  # (3,), (3,)
        across: ``across @ v = axis x v``.  # (3, 3)
        capsules: rows of ``Limb.capsules``.
        ends: their end points in the body's frame, start and end in turn [m].  # (3, 2 m)
    """

    body: int
    parent: int
    position: Array
    rotation: Array
    joint: int | None
    zero: float
    axis: Array
    offset: Array
    across: Array
    capsules: list[int]
    ends: Array


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
    def _links(self) -> list[_Link]:
        """Its bodies as numbers, parents first."""
        model, robot, out = self.robot.model, self.robot, []
        for body in self.bodies:
            joint, zero, axis, offset = None, 0.0, np.zeros(3), np.zeros(3)
            if body in self._moved:
                index = int(model.body_jntadr[body + 1])
                joint, zero = self._moved.index(body), float(model.qpos0[int(model.jnt_qposadr[index])])
                axis, offset = np.array(model.jnt_axis[index]), np.array(model.jnt_pos[index])
            mine = [row for row, c in enumerate(self.capsules) if robot.capsules[c].body == robot.body_names[body]]
            capsules = [robot.capsules[self.capsules[row]] for row in mine]
            ends = [end for capsule in capsules for end in (capsule.start, capsule.end)]
            x, y, z = axis
            out.append(
                _Link(
                    body=body,
                    parent=int(model.body_parentid[body + 1]) - 1,
                    position=np.array(model.body_pos[body + 1]),
                    rotation=_matrix(model.body_quat[body + 1]),
                    joint=joint,
                    zero=zero,
                    axis=axis,
                    across=np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]),
                    offset=offset,
                    capsules=mine,
                    ends=np.array(ends).reshape(-1, 3).T,
                )
            )
        return out

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
        count = len(angles)
        where = {self.root: (np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3)))}
        anchors, axes = np.empty((2, count, len(self._moved), 3))
        points = np.empty((count, len(self.capsules), 2, 3))
        for link in self._links:
            position, rotation = where[link.parent]
            position = position + _times(rotation, link.position)
            rotation = _times(rotation, link.rotation)
            if link.joint is not None:
                k, turn = link.joint, angles[:, link.joint] - link.zero
                anchors[:, k] = position + _times(rotation, link.offset)
                axes[:, k] = _times(rotation, link.axis)
                # R (I + sin(a) K + (1 - cos(a)) K^2)
                sine, cosine = np.sin(turn)[:, None, None], np.cos(turn)[:, None, None]
                across = _times(rotation, link.across)
                rotation = rotation + sine * across + (1.0 - cosine) * _times(across, link.across)
                position = anchors[:, k] - _times(rotation, link.offset)
            where[link.body] = (position, rotation)
            if link.capsules:
                ends = _times(rotation, link.ends).transpose(0, 2, 1) + position[:, None]
                points[:, link.capsules] = ends.reshape(count, -1, 2, 3)
        return points, anchors, axes

    def jacobian(self, points: Array, anchors: Array, axes: Array) -> Array:
        """Derivatives of the end points by the joints: ``a_k x (p - o_k)``.  # (N, C, 2, k, 3)"""
        out = cross(axes[:, None, None], points[:, :, :, None, :] - anchors[:, None, None])
        out *= self._moves[None, :, None, :, None]
        return out


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


def _times(matrices: Array, right: Array) -> Array:
    """Matrices, ``(N, 3, 3)``, times one of three rows or a vector, all at once: NumPy takes them one by one."""
    return np.asarray((matrices.reshape(-1, 3) @ right).reshape(len(matrices), 3, *right.shape[1:]))
