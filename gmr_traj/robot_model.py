"""Compiling a robot's model file, MJCF or URDF, into one MuJoCo model with a floating base and hinges."""

from __future__ import annotations

from pathlib import Path

import mujoco

from gmr_traj.exceptions import RobotError
from gmr_traj.robot_toml import RobotFile

_FREE, _HINGE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_HINGE)
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_PACKAGE = "package://"


def compile_model(file: RobotFile, keep: frozenset[str] | None = None) -> mujoco.MjModel:
    """Compile the model file of a robot: what ``model_spec`` makes of it.

    Raises:
        RobotError: as ``model_spec``; or MuJoCo cannot compile it, or it has joints other than one free joint at the
            base and at most one hinge in every other body.
    """
    spec = model_spec(file, keep)
    try:
        model = spec.compile()
    except ValueError as error:
        raise RobotError(f"{file.model}: MuJoCo cannot compile it: {_one_line(error)}") from error
    _check_joints(file, model)
    return model


def model_spec(file: RobotFile, keep: frozenset[str] | None = None) -> mujoco.MjSpec:
    """The model file of a robot, ready to be compiled or added to.

    The world's own shapes (a floor), shapes without contact that carry no mass, and everything that is not a body,
    joint, shape or site (keyframes, actuators, sensors, tendons, equality constraints) go.  A base without a free
    joint gets one.  Fixed joints of a URDF stay bodies of their own, so that their frames keep their names.

    Args:
        file: the robot's figures, which name the model file.
        keep: hinges to keep; the others are locked at zero.  None keeps all.

    Raises:
        RobotError: the file is missing or no model, holds more than one robot, or names a collision mesh that is not
            found.
    """
    if not file.model.is_file():
        raise RobotError(f"{file.path}: model {file.model} does not exist")
    try:
        spec = mujoco.MjSpec.from_file(str(file.model))
    except ValueError as error:
        raise RobotError(f"{file.model}: MuJoCo cannot read it: {_one_line(error)}") from error
    spec.compiler.fusestatic = False
    roots = spec.worldbody.bodies
    if len(roots) != 1:
        names = ", ".join(body.name for body in roots) or "none"
        raise RobotError(f"{file.model}: holds {len(roots)} trees of bodies ({names}); expected one robot")
    if not roots[0].joints:
        roots[0].add_freejoint(name="floating_base")
    _strip(spec)
    _drop_visuals(spec, file)
    if keep is not None:
        for joint in list(spec.joints):
            if int(joint.type) == _HINGE and joint.name not in keep:
                spec.delete(joint)
    return spec


def _strip(spec: mujoco.MjSpec) -> None:
    """Delete what has no part in a motion: keyframes and the like would not survive the locking of a joint."""
    extras = (spec.keys, spec.sensors, spec.actuators, spec.tendons, spec.equalities, spec.worldbody.geoms)
    for elements in extras:
        for element in list(elements):
            spec.delete(element)


def _drop_visuals(spec: mujoco.MjSpec, file: RobotFile) -> None:
    """Delete geoms without contact that carry no mass, and geoms whose mesh is not found."""
    spec.strippath = False
    missing = {
        mesh.name for mesh in spec.meshes if mesh.file and not locate_mesh(spec, mesh, file.model, file.mesh_folder)
    }
    for geom in list(spec.geoms):
        solid, is_mesh = bool(geom.contype or geom.conaffinity), int(geom.type) == _MESH
        absent = is_mesh and geom.meshname in missing
        if solid and absent and not file.ignore_missing_meshes:
            raise RobotError(
                f"{file.model}: body {geom.parent.name!r}: collision mesh {geom.meshname!r} is not found; name its "
                f"folder as mesh_folder in {file.path}, or set ignore_missing_meshes there and list [[capsules]]"
            )
        if absent or (not solid and geom.parent.explicitinertial):
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in missing:
            spec.delete(mesh)


def locate_mesh(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, model: Path, mesh_folder: Path | None) -> bool:
    """Point a mesh at its file: beside the model, in the mesh folder, or in the package a URDF names.

    Returns:
        whether there is such a file.
    """
    folders = [model.parent / spec.meshdir, model.parent]
    relative = mesh.file
    if relative.startswith(_PACKAGE):
        package, _, relative = relative.removeprefix(_PACKAGE).partition("/")
        folders = [folder for folder in model.resolve().parents if folder.name == package]
    if mesh_folder is not None:
        folders += [mesh_folder, mesh_folder / Path(relative).parent.name]
    names = (relative, Path(relative).name)
    found = next((folder / name for folder in folders for name in names if (folder / name).is_file()), None)
    if found is not None:
        mesh.file = str(found.resolve())
    return found is not None


def _check_joints(file: RobotFile, model: mujoco.MjModel) -> None:
    """One free joint at the base, at most one hinge in every other body, every hinge with a range."""
    for j in range(model.njnt):
        body, name = int(model.jnt_bodyid[j]), model.joint(j).name
        expected = _FREE if body == 1 else _HINGE
        if int(model.jnt_type[j]) != expected or int(model.body_jntnum[body]) != 1:
            raise RobotError(
                f"{file.model}: joint {name!r} of body {model.body(body).name!r}: expected one free joint at the base "
                "and at most one hinge in every other body (no slide or ball joints, no two joints in one body)"
            )
        low, high = model.jnt_range[j]
        if j > 0 and not (int(model.jnt_limited[j]) and low < high):
            raise RobotError(f"{file.model}: joint {name!r} has no range; every hinge needs a lower and an upper limit")
    if model.njnt < 2:
        raise RobotError(f"{file.model}: has no hinges; expected a robot with joints")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
