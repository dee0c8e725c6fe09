"""Retarget a DeepMimic clip to the Unitree G1 frame by frame, as GMR does, and write it for `gmr-traj refine`.

    pip download pybullet==3.2.7 --no-deps --dest /tmp/pybullet
    unzip -q /tmp/pybullet/pybullet-*.whl 'pybullet_data/*' -d /tmp/pybullet
    python tools/make_example.py /tmp/pybullet/pybullet_data examples/punch.npz

Each frame is solved on its own, from where the last one ended, in two stages: first the feet's positions and all
orientations, then all positions.  Nothing is smoothed, nothing is kept off the floor or out of the body, and the robot
starts in its zero configuration: the output has the faults that frame-by-frame retargeting has.

Method, weights and scales: Araujo et al., "Retargeting Matters" (GMR), the SMPL-X-to-G1 map.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import mink
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.formats.human import deepmimic
from gmr_traj.formats.human.decide import decide
from gmr_traj.human_motion import HumanMotion
from gmr_traj.robot_loading import load_robot

LOWER, UPPER = 0.9, 0.8  # scale of the lower body and spine, of the arms
MAX_ITERATIONS = 10
# All joint frames of the clip are this one when the person stands upright, facing x: y up, z to the right.
UPRIGHT = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
TOLERANCE = 1e-3  # change in the norm of a stage's errors below which it ends
DAMPING = 0.5


class Target(NamedTuple):
    """What a human joint tells a robot body.

    Attributes:
        joint: the human's joint.
        body: the robot's body.
        scale: of the joint's position relative to the root.
        stages: (position, orientation) cost in the first stage and in the second.
    """

    joint: str
    body: str
    scale: float
    stages: tuple[tuple[float, float], tuple[float, float]]


MAP = (
    Target("root", "pelvis", LOWER, ((100, 10), (100, 5))),
    Target("left_hip", "left_hip_roll_link", LOWER, ((0, 10), (10, 5))),
    Target("left_knee", "left_knee_link", LOWER, ((0, 10), (10, 5))),
    Target("left_ankle", "left_ankle_roll_link", LOWER, ((100, 10), (100, 50))),
    Target("right_hip", "right_hip_roll_link", LOWER, ((0, 10), (10, 5))),
    Target("right_knee", "right_knee_link", LOWER, ((0, 10), (10, 5))),
    Target("right_ankle", "right_ankle_roll_link", LOWER, ((100, 10), (100, 50))),
    Target("chest", "torso_link", LOWER, ((0, 10), (0, 10))),
    Target("left_shoulder", "left_shoulder_yaw_link", UPPER, ((0, 10), (10, 5))),
    Target("left_elbow", "left_elbow_link", UPPER, ((0, 10), (10, 5))),
    Target("left_wrist", "left_wrist_yaw_link", UPPER, ((0, 10), (10, 5))),
    Target("right_shoulder", "right_shoulder_yaw_link", UPPER, ((0, 10), (10, 5))),
    Target("right_elbow", "right_elbow_link", UPPER, ((0, 10), (10, 5))),
    Target("right_wrist", "right_wrist_yaw_link", UPPER, ((0, 10), (10, 5))),
)


def arms_hanging(model: mujoco.MjModel) -> mujoco.MjData:
    """The robot standing as the human stands whose joint frames are all ``UPRIGHT``."""
    data = mujoco.MjData(model)
    for name in ("left_elbow_joint", "right_elbow_joint"):
        data.qpos[model.joint(name).qposadr[0]] = np.pi / 2
    mujoco.mj_kinematics(model, data)
    return data


def targets(human: HumanMotion, model: mujoco.MjModel) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Scaled key-body targets: body -> positions (T, 3) [m], quaternions wxyz (T, 4), in the world.

    ``p = s_root p_root + s (p_human - p_root)`` and ``R = R_human R_upright^-1 R_offset``, the offset being the body's
    orientation in the robot's counterpart of the human's zero stance.
    """
    stance = arms_hanging(model)
    root = human.positions[:, 0]
    found = {}
    for target in MAP:
        index = human.index(target.joint)
        position = LOWER * root + target.scale * (human.positions[:, index] - root)
        offset = Rotation.from_quat(stance.body(target.body).xquat, scalar_first=True)
        rotation = Rotation.from_quat(human.quaternions[:, index], scalar_first=True) * UPRIGHT.inv() * offset
        found[target.body] = position, rotation.as_quat(scalar_first=True)
    return found


def retarget(human: HumanMotion, model: mujoco.MjModel) -> np.ndarray:
    """Two-stage inverse kinematics, frame by frame, each frame from where the last one ended.

    Returns:
        Configurations.  # (T, nq)
    """
    goal = targets(human, model)
    stages = [{t.body: mink.FrameTask(t.body, "body", *t.stages[k], lm_damping=1.0) for t in MAP} for k in (0, 1)]
    configuration = mink.Configuration(model)
    start = np.zeros(model.nq)
    start[:7] = 0, 0, model.qpos0[2], 1, 0, 0, 0
    configuration.update(start)
    limits = [mink.ConfigurationLimit(model)]
    solution = []
    for t in range(len(human.positions)):
        for stage in stages:
            for body, task in stage.items():
                position, quaternion = goal[body][0][t], goal[body][1][t]
                task.set_target(mink.SE3(np.concatenate([quaternion, position])))
            tasks = list(stage.values())
            error = float("inf")
            for _ in range(MAX_ITERATIONS + 1):
                velocity = mink.solve_ik(configuration, tasks, model.opt.timestep, "daqp", DAMPING, limits=limits)
                configuration.integrate_inplace(velocity, model.opt.timestep)
                last, error = error, float(np.linalg.norm([task.compute_error(configuration) for task in tasks]))
                if last - error < TOLERANCE:
                    break
        solution.append(configuration.q.copy())
    return np.stack(solution)


def main() -> None:
    """Read the arguments, retarget, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pybullet_data", type=Path, help="folder pybullet_data of the package pybullet")
    parser.add_argument("output", type=Path, help="npz file to write")
    parser.add_argument("--clip", default="punch", help="which humanoid3d_<clip>.txt (default: %(default)s)")
    parser.add_argument("--cycles", type=int, default=1, help="how often to play a cyclic clip (default: %(default)s)")
    parser.add_argument("--fps", type=float, default=30.0, help="frames per second (default: %(default)s)")
    arguments = parser.parse_args()
    source = arguments.pybullet_data / "data" / "motions" / f"humanoid3d_{arguments.clip}.txt"
    human = decide(deepmimic.read(source.read_bytes(), arguments.fps, arguments.cycles))
    robot = load_robot("unitree_g1")
    qpos = retarget(human, robot.model)
    np.savez_compressed(
        arguments.output, qpos=qpos, fps=arguments.fps, joint_names=np.array(robot.joint_names), robot=robot.name
    )
    print(f"{arguments.output}: {len(qpos)} frames, {len(qpos) / arguments.fps:.1f} s")


if __name__ == "__main__":
    main()
