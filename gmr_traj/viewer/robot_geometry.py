"""What a robot looks like: its collision shapes, and the meshes of its links where there are any."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gmr_traj.colours import RGB
from gmr_traj.link_meshes import LinkMesh
from gmr_traj.robot import Capsule
from gmr_traj.track import Track
from gmr_traj.viewer.motion_columns import frame_name
from gmr_traj.viewer.paths import part

if TYPE_CHECKING:
    import rerun as rr

TRANSLUCENT = 0.35


def shapes_path(track: Track) -> str:
    """Where the collision shapes are logged; hiding this hides all of them."""
    return f"/world/{part(track.name)}/shapes"


def meshes_path(track: Track) -> str:
    """Where the link meshes are logged."""
    return f"/world/{part(track.name)}/meshes"


def log_shapes(stream: rr.RecordingStream, track: Track, colour: RGB, opacity: float) -> None:
    """Log the collision shapes, body by body, static in the frames of their bodies."""
    import rerun as rr

    for body in dict.fromkeys(capsule.body for capsule in track.robot.capsules):
        own = [capsule for capsule in track.robot.capsules if capsule.body == body]
        stream.log(
            f"{shapes_path(track)}/{part(body)}",
            rr.CoordinateFrame(frame_name(track, body)),
            rr.Capsules3D(
                lengths=[float(np.linalg.norm(c.end - c.start)) for c in own],
                radii=[c.radius for c in own],
                translations=np.array([c.start for c in own]),
                quaternions=np.array([capsule_rotation(c) for c in own]),
                colors=[(*colour, round(255 * opacity))] * len(own),
                fill_mode=rr.components.FillMode.Solid,
            ),
            static=True,
        )


def log_meshes(
    stream: rr.RecordingStream, track: Track, meshes: tuple[LinkMesh, ...], colour: RGB, opacity: float
) -> None:
    """Log the link meshes, one entity a mesh, static in the frames of their bodies."""
    import rerun as rr

    for k, mesh in enumerate(meshes):
        stream.log(
            f"{meshes_path(track)}/{part(mesh.body)}/{k}",
            rr.CoordinateFrame(frame_name(track, mesh.body)),
            rr.Mesh3D(
                vertex_positions=mesh.vertices.astype(np.float32),
                vertex_normals=mesh.normals.astype(np.float32),
                triangle_indices=mesh.faces,
                albedo_factor=(*colour, round(255 * opacity)),
            ),
            static=True,
        )


def capsule_rotation(capsule: Capsule) -> np.ndarray:
    """The rotation, xyzw, that turns the z axis to the capsule's: ``(z x u, 1 + z . u)``, normalised."""
    axis = capsule.end - capsule.start
    length = np.linalg.norm(axis)
    if length == 0.0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = axis / length
    if z < -1.0 + 1e-9:
        return np.array([1.0, 0.0, 0.0, 0.0])  # half a turn about x
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / np.linalg.norm(quaternion)
