"""Render the same frames of several clips, one row a clip, by MuJoCo without a window.

    MUJOCO_GL=egl python tools/film_strip.py examples/punch.npz examples/punch_refined.npz --picture docs/strip.png

What is drawn are the collision shapes of the robot; those that overlap by more than a millimetre are red.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

from gmr_traj.formats import read_clip
from gmr_traj.metrics.observation import observe
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot

WIDTH, HEIGHT = 220, 260
BODY, OVERLAP, FLOOR = (0.55, 0.6, 0.66, 1.0), (0.85, 0.2, 0.2, 1.0), (1.0, 1.0, 1.0, 1.0)
OVERLAP_DEPTH = 1e-3  # [m]


def stage(robot: Robot) -> mujoco.MjModel:
    """A scene with floor and light, and one geom a collision shape, placed by hand in every frame."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = WIDTH, HEIGHT
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.5] * 3, [0.5] * 3
    spec.visual.headlight.specular = [0.0] * 3
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[1, 1, 1],
        width=8,
        height=8,
    )
    spec.worldbody.add_light(pos=[1.0, -2.0, 4.0], dir=[-0.2, 0.4, -1.0])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 0.1], rgba=FLOOR)
    for capsule in robot.capsules:
        length = float(np.linalg.norm(capsule.end - capsule.start))
        body = spec.worldbody.add_body(mocap=True)
        if length > 0.0:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[capsule.radius, length / 2, 0.0])
        else:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[capsule.radius, 0.0, 0.0])
    return spec.compile()


def row(motion: RobotMotion, robot: Robot, frames: np.ndarray, azimuth: float) -> np.ndarray:
    """The given frames side by side.  # (HEIGHT, WIDTH * frames, 3)."""
    model = stage(robot)
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 2.1, azimuth, -8.0
    seen = observe(motion, robot)
    index = {name: i for i, name in enumerate(robot.body_names)}
    pictures = []
    for t in frames:
        deep = (seen.overlaps.frame == t) & (seen.overlaps.depth > OVERLAP_DEPTH)
        touching = {c for pair in seen.overlaps.pair[deep] for c in robot.collision_pairs[pair]}
        for c, capsule in enumerate(robot.capsules):
            R = seen.rotations[t, index[capsule.body]]
            start, end = (seen.positions[t, index[capsule.body]] + R @ p for p in (capsule.start, capsule.end))
            data.mocap_pos[c] = (start + end) / 2
            mujoco.mju_quatZ2Vec(data.mocap_quat[c], end - start)
            model.geom_rgba[c + 1] = OVERLAP if c in touching else BODY
        mujoco.mj_kinematics(model, data)
        camera.lookat[:] = *motion.qpos[t, :2], 0.62
        renderer.update_scene(data, camera)
        pictures.append(renderer.render())
    renderer.close()
    return np.concatenate(pictures, axis=1)


def main() -> None:
    """Read the clips, render, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", type=Path, nargs="+", help="clips of the Unitree G1, one row each")
    parser.add_argument("--picture", type=Path, required=True, help="PNG to write")
    parser.add_argument("--columns", type=int, default=9, help="frames in a row (default: %(default)s)")
    parser.add_argument("--seconds", type=float, nargs=2, help="stretch of the clips to show (default: all)")
    parser.add_argument("--azimuth", type=float, default=140.0, help="of the camera [deg] (default: %(default)s)")
    arguments = parser.parse_args()
    count = len(arguments.clips)
    size = (arguments.columns * WIDTH / 100, count * HEIGHT / 100)
    figure, axes = plt.subplots(count, 1, figsize=size, squeeze=False, layout="compressed")
    for axis, path in zip(axes[:, 0], arguments.clips, strict=True):
        robot = load_robot("unitree_g1")
        motion = read_clip(path, robot).motion
        if motion.joint_names != robot.joint_names:
            robot = reduce_robot(robot, motion.joint_names)
        begin, end = arguments.seconds or (0.0, motion.duration)
        first, last = int(begin * motion.fps), min(motion.frames, int(np.ceil(end * motion.fps))) - 1
        frames = np.linspace(first, last, arguments.columns).round().astype(int)
        axis.imshow(row(motion, robot, frames, arguments.azimuth))
        axis.set_xticks(WIDTH * (np.arange(len(frames)) + 0.5), [f"{t / motion.fps:.2f} s" for t in frames])
        axis.set_yticks([])
        axis.set_ylabel(path.name)
        axis.tick_params(length=0)
        axis.spines[:].set_visible(False)
    figure.savefig(arguments.picture, dpi=100)


if __name__ == "__main__":
    main()
