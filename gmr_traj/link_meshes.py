"""The meshes of a robot's links, for pictures only: nothing is computed with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Robot
from gmr_traj.robot_model import locate_mesh
from gmr_traj.robot_toml import RobotFile, read_robot_toml

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


@dataclass(frozen=True)
class LinkMesh:
    """A triangle mesh that moves with a body.

    Attributes:
        body: the body.
        vertices: in the body's frame [m].  # (V, 3)
        normals: outward, unit.  # (V, 3)
        faces: three indices of vertices each.  # (F, 3)
    """

    body: str
    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray


def link_meshes(robot: Robot) -> tuple[LinkMesh, ...]:
    """Meshes of a robot's links, none where there are none.

    They come from the model that ``[looks]`` of the robot.toml names, where the package that carries it is installed,
    and from the robot's own model otherwise.  A body that the robot does not have (a logo, a finger) moves with the
    closest body before it that the robot has.

    Raises:
        RobotError: the model of the looks is not what robot.toml says it is.
    """
    file = read_robot_toml(robot.path)
    source = _looks(file)
    if source is None:
        source = file.model
    try:
        spec = _with_visuals(source)
        spec.compiler.fusestatic, spec.strippath = False, False
        _drop_missing(spec, file, source)
        model = spec.compile()
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise RobotError(f"{source}: MuJoCo cannot read it for its meshes: {' '.join(str(error).split())}") from error
    return tuple(_meshes(model, robot))


def _looks(file: RobotFile) -> Path | None:
    """The model that shows what the robot looks like, None where it is not installed."""
    if file.looks is None:
        return None
    package, name = file.looks
    try:
        files = metadata.files(package) or []
    except metadata.PackageNotFoundError:
        return None
    found = [entry for entry in files if entry.name == name]
    if not found:
        raise RobotError(f"{file.path}: [looks] the installed package {package} has no file {name}")
    return Path(str(found[0].locate())).resolve()


def _with_visuals(source: Path) -> mujoco.MjSpec:
    """The model with its shapes for looking at, which MuJoCo leaves out of a URDF unless the URDF asks for them."""
    if source.suffix != ".urdf":
        return mujoco.MjSpec.from_file(str(source))
    root = ElementTree.parse(source).getroot()
    for own in root.findall("mujoco"):
        root.remove(own)
    ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", discardvisual="false")
    return mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))


def _drop_missing(spec: mujoco.MjSpec, file: RobotFile, source: Path) -> None:
    """Delete geoms whose mesh is not found."""
    for mesh in list(spec.meshes):
        if mesh.file and not locate_mesh(spec, mesh, source, file.mesh_folder):
            for geom in [geom for geom in spec.geoms if geom.meshname == mesh.name]:
                spec.delete(geom)
            spec.delete(mesh)


def _meshes(model: mujoco.MjModel, robot: Robot) -> Iterator[LinkMesh]:
    """Mesh geoms in the frames of the robot's bodies: of each body those for looking at, else its solid ones."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geoms = [g for g in range(model.ngeom) if int(model.geom_type[g]) == _MESH]
    for_looks = {int(model.geom_bodyid[g]) for g in geoms if not _solid(model, g)}
    for g in geoms:
        owner = int(model.geom_bodyid[g])
        if owner in for_looks and _solid(model, g):
            continue
        while owner and model.body(owner).name not in robot.body_names:
            owner = int(model.body_parentid[owner])
        if not owner:
            continue
        R_world_body, R_world_geom = data.xmat[owner].reshape(3, 3), data.geom_xmat[g].reshape(3, 3)
        R_body_geom = R_world_body.T @ R_world_geom
        offset = R_world_body.T @ (data.geom_xpos[g] - data.xpos[owner])
        vertices, normals, faces = _corners(model, int(model.geom_dataid[g]))
        yield LinkMesh(model.body(owner).name, vertices @ R_body_geom.T + offset, normals @ R_body_geom.T, faces)


def _solid(model: mujoco.MjModel, g: int) -> bool:
    return bool(int(model.geom_contype[g]) or int(model.geom_conaffinity[g]))


def _corners(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and faces of a mesh; a vertex on an edge is there once for each of its normals."""
    at, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    corners = np.stack(
        [model.mesh_face[at : at + count].ravel(), model.mesh_facenormal[at : at + count].ravel()], axis=1
    )  # (3 F, 2)
    different, place = np.unique(corners, axis=0, return_inverse=True)
    vertices = model.mesh_vert[int(model.mesh_vertadr[mesh]) :][different[:, 0]]
    normals = model.mesh_normal[int(model.mesh_normaladr[mesh]) :][different[:, 1]]
    return vertices.astype(float), normals.astype(float), place.reshape(-1, 3).astype(np.uint32)
