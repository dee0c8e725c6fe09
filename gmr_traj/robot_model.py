"""Compiling a robot's model file, MJCF or URDF, into one MuJoCo model with a floating base and hinges."""

from __future__ import annotations

from pathlib import Path

import mujoco

from gmr_traj.exceptions import RobotError
from gmr_traj.robot_toml import RobotFile

_FREE, _HINGE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_HINGE)
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


def load_spec(file: RobotFile) -> mujoco.MjSpec:
    """Read the model file of a robot, as an editable MuJoCo specification.

    The world's own shapes (a floor) go; a base without a free joint gets one; shapes that only serve the eye go;
    a URDF's fixed joints stay bodies of their own, so that their frames keep their names.

    Raises:
        RobotError: the file is missing or not a model, holds more than one robot, or a collision mesh is not found.
    """
    if not file.model.is_file():
        raise RobotError(f"{file.path}: model {file.model} does not exist")
    try:
        spec = mujoco.MjSpec.from_file(str(file.model))
    except ValueError as error:
        raise RobotError(f"{file.model}: MuJoCo cannot read it: {one_line(error)}") from error
    spec.compiler.fusestatic = False
    for geom in list(spec.worldbody.geoms):
        spec.delete(geom)
    roots = spec.worldbody.first_body(), spec.worldbody.next_body(spec.worldbody.first_body())
    if roots[0] is None:
        raise RobotError(f"{file.model}: holds no body")
    if roots[1] is not None:
        raise RobotError(f"{file.model}: holds more than one tree of bodies ({roots[0].name}, {roots[1].name}); expected one robot")
    if not roots[0].joints:
        roots[0].add_freejoint(name="floating_base")
    _drop_visuals(spec, file)
    return spec


def _drop_visuals(spec: mujoco.MjSpec, file: RobotFile) -> None:
    """Delete geoms without contact and geoms whose mesh is missing; complain about missing collision meshes."""
    missing = {mesh.name for mesh in spec.meshes if mesh.file and not _locate(spec, mesh, file)}
    for geom in list(spec.geoms):
        solid = bool(geom.contype or geom.conaffinity)
        is_mesh = int(geom.type) == _MESH
        absent = is_mesh and geom.meshname in missing
        if solid and absent and not file.ignore_missing_meshes:
            raise RobotError(
                f"{file.model}: body {geom.parent.name}: collision mesh {geom.meshname!r} is not found; "
                f"name its folder as mesh_folder in {file.path.name}, or set ignore_missing_meshes and list [[capsules]]"
            )
        if absent or (not solid and (not is_mesh or geom.parent.explicitinertial)):
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in missing:
            spec.delete(mesh)


def _locate(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, file: RobotFile) -> bool:
    """Point a mesh at its file; False where there is none."""
    relative = Path(mesh.file)
    folders = [file.model.parent / spec.meshdir, file.model.parent]
    if file.mesh_folder is not None:
        folders.insert(0, file.mesh_folder)
    for folder in folders:
        if (folder / relative).is_file():
            mesh.file = str((folder / relative).resolve())
            return True
    return False


def compile_spec(spec: mujoco.MjSpec, file: RobotFile) -> mujoco.MjModel:
    """Compile a specification and check that it is a floating base with hinges, at most one a body.

    Raises:
        RobotError: MuJoCo refuses it, or it has another kind of joint.
    """
    try:
        model = spec.compile()
    except ValueError as error:
        raise RobotError(f"{file.model}: MuJoCo cannot compile it: {one_line(error)}") from error
    for j in range(model.njnt):
        kind, body = int(model.jnt_type[j]), int(model.jnt_bodyid[j])
        expected = _FREE if body == 1 else _HINGE
        if kind != expected or int(model.body_jntnum[body]) != 1:
            raise RobotError(
                f"{file.model}: joint {model.joint(j).name!r} of body {model.body(body).name!r}: expected one free joint at the "
                "base and at most one hinge in every other body (no slide or ball joints, no two joints in one body)"
            )
    return model


def one_line(error: Exception) -> str:
    """An error's message without line breaks."""
    return " ".join(str(error).split())
