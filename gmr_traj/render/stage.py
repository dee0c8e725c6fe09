"""A MuJoCo scene with a floor, light and one robot, whose parts are placed by hand in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from gmr_traj.link_meshes import LinkMesh, link_meshes
from gmr_traj.robot import Robot

BODY, OVERLAP = (0.70, 0.73, 0.78, 1.0), (0.88, 0.12, 0.16, 1.0)
FLOOR, MARKS, SKY = (0.84, 0.845, 0.85), (0.77, 0.78, 0.795), (1.0, 1.0, 1.0)
LAMP = (1.0, -1.6, 4.0)  # from the robot to the lamp [m]
TILE = 0.5  # edge of a floor tile [m]


@dataclass(frozen=True)
class Stage:
    """The scene.

    Attributes:
        model: its MuJoCo model.
        robot: whose parts it holds.
        bodies: index into ``robot.body_names`` of each part, in the order of the model's mocap bodies.
        parts: names of the collision shapes that turn a part red; parts are moved with their bodies.
        geoms: geoms of each part.
    """

    model: mujoco.MjModel
    robot: Robot
    bodies: tuple[int, ...]
    parts: tuple[frozenset[int], ...]
    geoms: tuple[tuple[int, ...], ...]

    def place(self, data: mujoco.MjData, positions: np.ndarray, rotations: np.ndarray, touching: set[int]) -> None:
        """Put every part where its body is, and colour those that overlap.

        Args:
            data: of the model.
            positions: origins of the robot's bodies [m].  # (B, 3)
            rotations: their orientations.  # (B, 3, 3)
            touching: collision shapes that overlap another.
        """
        for part, body in enumerate(self.bodies):
            data.mocap_pos[part] = positions[body]
            mujoco.mju_mat2Quat(data.mocap_quat[part], rotations[body].ravel())
            for geom in self.geoms[part]:
                self.model.geom_rgba[geom] = OVERLAP if self.parts[part] & touching else BODY
        self.model.light_pos[0, :2] = positions[0, :2] + LAMP[:2]
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_camlight(self.model, data)


def build(robot: Robot, meshes: bool, size: tuple[int, int]) -> Stage:
    """A stage for a robot.

    Collision shapes are parts of their own, so that the two that overlap turn red; a body drawn with its meshes turns
    red as a whole.

    Args:
        robot: the robot.
        meshes: whether to draw the meshes of its links where there are any.
        size: width and height of the pictures [pixels].
    """
    spec = _empty(size)
    found = link_meshes(robot) if meshes else ()
    place = {name: i for i, name in enumerate(robot.body_names)}
    bodies: list[int] = []
    parts: list[frozenset[int]] = []
    if found:
        for name in dict.fromkeys(mesh.body for mesh in found):
            _add_meshes(spec, [mesh for mesh in found if mesh.body == name], len(bodies))
            bodies.append(place[name])
            parts.append(frozenset(c for c, capsule in enumerate(robot.capsules) if capsule.body == name))
    else:
        for c, capsule in enumerate(robot.capsules):
            body = spec.worldbody.add_body(name=f"part{len(bodies)}", mocap=True)
            if np.array_equal(capsule.start, capsule.end):
                kind, ends = mujoco.mjtGeom.mjGEOM_SPHERE, {"pos": capsule.start}
            else:
                kind, ends = mujoco.mjtGeom.mjGEOM_CAPSULE, {"fromto": np.concatenate([capsule.start, capsule.end])}
            body.add_geom(type=kind, size=[capsule.radius, 0.0, 0.0], **ends)
            bodies.append(place[capsule.body])
            parts.append(frozenset([c]))
    model = spec.compile()
    owners = [model.body(f"part{part}").id for part in range(len(bodies))]
    geoms = tuple(tuple(np.flatnonzero(model.geom_bodyid == owner).tolist()) for owner in owners)
    return Stage(model, robot, tuple(bodies), tuple(parts), geoms)


def _empty(size: tuple[int, int]) -> mujoco.MjSpec:
    """Floor, sky and light."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    spec.visual.quality.offsamples, spec.visual.quality.shadowsize = 4, 4096
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.5] * 3, [0.3] * 3
    spec.visual.headlight.specular = [0.05] * 3
    spec.visual.map.zfar = 60.0
    texture = mujoco.mjtTexture
    flat, checker = mujoco.mjtBuiltin.mjBUILTIN_FLAT, mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    spec.add_texture(name="sky", type=texture.mjTEXTURE_SKYBOX, builtin=flat, rgb1=SKY, rgb2=SKY, width=8, height=48)
    spec.add_texture(
        name="floor", type=texture.mjTEXTURE_2D, builtin=checker, rgb1=FLOOR, rgb2=MARKS, width=256, height=256
    )
    material = spec.add_material(name="floor", texuniform=True, texrepeat=[0.5 / TILE, 0.5 / TILE], reflectance=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    spec.worldbody.add_light(pos=LAMP, dir=[-value for value in LAMP], diffuse=[0.5] * 3, castshadow=True,
                             type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)  # fmt: skip
    spec.stat.extent, spec.stat.center = 2.0, [0.0, 0.0, 0.5]
    spec.visual.map.shadowclip = 11.0  # the edge of the shadow map, a line of noise, is out of sight
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], material="floor")
    return spec


def _add_meshes(spec: mujoco.MjSpec, meshes: list[LinkMesh], part: int) -> None:
    """One mocap body with the meshes of one body, whose vertices are in the body's frame."""
    body = spec.worldbody.add_body(name=f"part{part}", mocap=True)
    for k, mesh in enumerate(meshes):
        name = f"part{part}_{k}"
        spec.add_mesh(
            name=name,
            uservert=mesh.vertices.ravel(),
            userface=mesh.faces.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0)
