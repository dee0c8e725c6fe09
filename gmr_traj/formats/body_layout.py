"""The bodies a file lists, told apart by where they are: bodies of the robot, and further ones fixed to them.

Files list bodies that a robot description does not have (a toe, a head marker, rubber hands, the world).  Each is
fixed to some body that it does have, so its place in a changed motion follows from the place it had in the file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

_WORLD = ""
_RADIUS = 0.1  # an orientation error of one radian counts like 0.1 m of position
_SAMPLES = 64


@dataclass(frozen=True)
class BodyLayout:
    """For each body of a file the robot's body it is fixed to, and how.

    Attributes:
        bodies: names of the robot's bodies; empty for one that stands still in the world.  # F
        offsets: origin of the file's body in that body's frame [m].  # (F, 3)
        rotations: orientation of the file's body in that body's frame, wxyz.  # (F, 4)
        residuals: how far the file's bodies leave these places within the clip [m].  # (F,)
    """

    bodies: tuple[str, ...]
    offsets: np.ndarray
    rotations: np.ndarray
    residuals: np.ndarray

    @staticmethod
    def plain(bodies: tuple[str, ...]) -> BodyLayout:
        """Bodies of the robot as they are; an empty name is the world."""
        count = len(bodies)
        return BodyLayout(bodies, np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1)), np.zeros(count))

    def place(
        self, names: tuple[str, ...], positions: np.ndarray, rotations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Placements of the file's bodies from those of the robot's.

            T_world_file = T_world_body T_body_file

        Args:
            names: names of the robot's bodies.  # B
            positions: their origins [m].  # (T, B, 3)
            rotations: their rotation matrices.  # (T, B, 3, 3)

        Returns:
            positions [m]  # (T, F, 3), rotation matrices  # (T, F, 3, 3)
        """
        frames = len(positions)
        out_positions = np.empty((frames, len(self.bodies), 3))
        out_rotations = np.empty((frames, len(self.bodies), 3, 3))
        local = Rotation.from_quat(self.rotations, scalar_first=True).as_matrix()
        for k, body in enumerate(self.bodies):
            if body == _WORLD:
                out_positions[:, k], out_rotations[:, k] = self.offsets[k], local[k]
                continue
            b = names.index(body)
            out_positions[:, k] = positions[:, b] + rotations[:, b] @ self.offsets[k]
            out_rotations[:, k] = rotations[:, b] @ local[k]
        return out_positions, out_rotations


def attach(
    names: tuple[str, ...],
    known: dict[str, int],
    positions: np.ndarray,
    rotations: np.ndarray | None,
    frames: tuple[np.ndarray, np.ndarray],
) -> BodyLayout:
    """Find what each body of a file is fixed to.

    Args:
        names: names of the robot's bodies, in its order.  # B
        known: where in the file each of the robot's bodies is, as far as the file has it.
        positions: origins of the file's bodies [m].  # (T, F, 3)
        rotations: their rotation matrices, None where the file has none.  # (T, F, 3, 3)
        frames: positions (T, B, 3) and rotation matrices (T, B, 3, 3) of the robot's bodies in the same motion and the
            same world.  Those in ``known`` are taken from the file where it has their rotations: its robot may differ
            from ours by millimetres, and only relative to its own bodies are further bodies exactly fixed.
    """
    every = np.unique(np.linspace(0, len(positions) - 1, _SAMPLES).astype(int))
    own_positions, own_rotations = frames[0][every], frames[1][every]
    points = positions[every]
    turns = None if rotations is None else rotations[every]
    if turns is not None:
        for name, f in known.items():
            own_positions[:, names.index(name)], own_rotations[:, names.index(name)] = points[:, f], turns[:, f]
    layout = BodyLayout.plain((_WORLD,) * points.shape[1])
    bodies = list(layout.bodies)
    for name, f in known.items():
        bodies[f] = name
    for f in sorted(set(range(points.shape[1])) - set(known.values())):
        turn = None if turns is None else turns[:, f]
        bodies[f], layout.offsets[f], layout.rotations[f], layout.residuals[f] = _attach_one(
            names, points[:, f], turn, own_positions, own_rotations
        )
    return BodyLayout(tuple(bodies), layout.offsets, layout.rotations, layout.residuals)


def _attach_one(
    names: tuple[str, ...], point: np.ndarray, turn: np.ndarray | None, positions: np.ndarray, rotations: np.ndarray
) -> tuple[str, np.ndarray, np.ndarray, float]:
    """The body in whose frame the point (and the turn) move least, the nearest of equals; the world at its origin."""
    turns = np.tile(np.eye(3), (len(point), 1, 1)) if turn is None else turn
    candidates = [(_WORLD, point, turns)]
    if point.any():
        inverse = np.swapaxes(rotations, 2, 3)
        offsets = np.einsum("tbij,tbj->tbi", inverse, point[:, None] - positions)
        candidates = [(n, offsets[:, b], turns if turn is None else inverse[:, b] @ turn) for b, n in enumerate(names)]
    spreads = [_spread(offset, rotation) for _, offset, rotation in candidates]
    nearest = [float(np.linalg.norm(offset[0])) for _, offset, _ in candidates]
    best = min(range(len(candidates)), key=lambda c: (round(spreads[c], 6), nearest[c]))
    body, offset, rotation = candidates[best]
    quaternion = Rotation.from_matrix(rotation[0]).as_quat(scalar_first=True)
    return body, np.median(offset, axis=0), quaternion, spreads[best]


def _spread(offsets: np.ndarray, rotations: np.ndarray) -> float:
    """How far offsets and rotations leave their first value [m]."""
    turned = np.linalg.norm(rotations - rotations[0], axis=(1, 2)).max() / np.sqrt(2.0)
    return float(np.linalg.norm(offsets - offsets[0], axis=1).max() + _RADIUS * turned)
