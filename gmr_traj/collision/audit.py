"""Self-penetration on the model's own collision geometry, by python-fcl.

Shares no distance code with the problem: FCL's GJK and EPA on the geoms of the model file (boxes, meshes, ...), where
the problem has closed forms on capsules that cover them. The capsules only say where to look.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import product

import fcl
import numpy as np

from gmr_traj.collision.broadphase import candidates
from gmr_traj.collision.fcl_shapes import Shape, capsule_shape, geom_shapes
from gmr_traj.collision.segments import Array
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

#: Clearance of the covering capsules below which the geometry inside is looked at [m].
MARGIN = 0.01

#: Overlaps up to this are not reported: FCL's EPA was seen to be off by as much on smooth shapes [m].
ACCURACY = 2e-4


@dataclass(frozen=True)
class Penetration:
    """Two shapes that overlap in at least one frame.

    Attributes:
        shapes: their names.
        bodies: the bodies they belong to.
        frames: the frames in which they overlap, ascending.  # (F,)
        depths: penetration depths in those frames [m], positive.  # (F,)
    """

    shapes: tuple[str, str]
    bodies: tuple[str, str]
    frames: np.ndarray
    depths: np.ndarray

    @property
    def depth(self) -> float:
        """The deepest penetration [m]."""
        return float(self.depths.max())

    @property
    def frame(self) -> int:
        """The frame of the deepest penetration."""
        return int(self.frames[int(np.argmax(self.depths))])


def audit(robot: Robot, qpos: Array, *, margin: float = MARGIN, accuracy: float = ACCURACY) -> list[Penetration]:
    """Overlaps of the model's collision geometry in a clip, the deepest first.

    A capsule stands for the geom of its name on its body; without one, for all collision geoms of its body (of which
    pairs that overlap in the nominal configuration are left out, being neighbours by design); without any, for itself.

    Args:
        robot: the robot; its ``collision_pairs`` are audited.
        qpos: configurations.  # (T, 7 + n)
        margin: clearance of the capsules below which their geoms are looked at [m].
        accuracy: overlaps up to this are not reported [m].

    Returns:
        one entry a pair of shapes that overlaps; empty if none does.

    Raises:
        RobotError: the model has collision geoms that are not convex.
    """
    positions, rotations = placements(robot, np.asarray(qpos, dtype=np.float64))
    shapes, of_capsule = _shapes(robot)
    todo: defaultdict[tuple[int, int], set[int]] = defaultdict(set)
    for candidate in candidates(robot, positions, rotations, margin):
        i, j = candidate.pair
        for a, b in product(of_capsule[i], of_capsule[j]):
            todo[min(a, b), max(a, b)].update(candidate.frames.tolist())
    at_rest = _Scene(robot, shapes, *placements(robot, robot.nominal[None]))
    scene = _Scene(robot, shapes, positions, rotations)
    out = []
    for (a, b), frames in sorted(todo.items()):
        if not (_is_named(robot, shapes[a]) and _is_named(robot, shapes[b])) and at_rest.distance(a, b, 0) < 0:
            continue
        when = np.array(sorted(frames))
        depths = -np.array([scene.distance(a, b, t) for t in when])
        deep = depths > accuracy
        if deep.any():
            names, bodies = (shapes[a].name, shapes[b].name), (shapes[a].body, shapes[b].body)
            out.append(Penetration(names, bodies, when[deep], depths[deep]))
    return sorted(out, key=lambda penetration: -penetration.depth)


class _Scene:
    """The shapes of a robot in the frames of a clip."""

    def __init__(self, robot: Robot, shapes: list[Shape], positions: Array, rotations: Array) -> None:
        body = {name: index for index, name in enumerate(robot.body_names)}
        self._bodies = [body[shape.body] for shape in shapes]
        self._shapes, self._positions, self._rotations = shapes, positions, rotations
        self._objects = [fcl.CollisionObject(shape.geometry) for shape in shapes]
        self._request = fcl.DistanceRequest(enable_signed_distance=True)

    def distance(self, a: int, b: int, frame: int) -> float:
        """Signed distance of two shapes in one frame [m]."""
        for s in (a, b):
            position, rotation = self._positions[frame, self._bodies[s]], self._rotations[frame, self._bodies[s]]
            placed = fcl.Transform(rotation @ self._shapes[s].rotation, position + rotation @ self._shapes[s].position)
            self._objects[s].setTransform(placed)
        return float(fcl.distance(self._objects[a], self._objects[b], self._request, fcl.DistanceResult()))


def _shapes(robot: Robot) -> tuple[list[Shape], list[list[int]]]:
    """The shapes to audit, and for each capsule the indices of those it stands for."""
    shapes = list(geom_shapes(robot.model))
    of_capsule = []
    for capsule in robot.capsules:
        on_body = [s for s, shape in enumerate(shapes) if shape.body == capsule.body]
        named = [s for s in on_body if shapes[s].name == capsule.name]
        if not on_body:
            shapes.append(capsule_shape(capsule))
            named = [len(shapes) - 1]
        of_capsule.append(named or on_body)
    return shapes, of_capsule


def _is_named(robot: Robot, shape: Shape) -> bool:
    """Whether the robot has a capsule for exactly this shape, so that its pairs are meant literally."""
    return any(capsule.name == shape.name and capsule.body == shape.body for capsule in robot.capsules)
