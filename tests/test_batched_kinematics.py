from __future__ import annotations

import numpy as np
import pytest
from conftest import random_configurations
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import RobotError
from gmr_traj.kinematics.batched_kinematics import BatchedKinematics, left_jacobian
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

POINTS = [
    ("pelvis", np.array([0.1, 0.0, -0.2])),
    ("left_ankle_roll_link", np.array([0.08, 0.0, -0.03])),
    ("left_ankle_roll_link", np.zeros(3)),
    ("torso_link", np.array([0.0, 0.0, 0.42])),
    ("right_wrist_yaw_link", np.array([0.05, 0.02, 0.0])),
]


def split(qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return qpos[:, :3], Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_matrix(), qpos[:, 7:]


@pytest.mark.parametrize("name", ["g1", "talos"])
def test_points_are_where_mujoco_has_them(name, request):
    robot: Robot = request.getfixturevalue(name)
    points = [(body, np.array([0.1, -0.2, 0.05 * k])) for k, body in enumerate(robot.body_names)]
    qpos = random_configurations(robot, 7, seed=1)
    positions, rotations = placements(robot, qpos)
    expected = positions + np.einsum("tbij,bj->tbi", rotations, np.array([p for _, p in points]))
    placed = BatchedKinematics(robot, points).place(*split(qpos))
    np.testing.assert_allclose(placed.points, expected, atol=1e-12)


@pytest.mark.parametrize("name", ["g1", "talos"])
def test_the_gradient_by_finite_differences(name, request):
    robot: Robot = request.getfixturevalue(name)
    points = POINTS if name == "g1" else [(body, np.array([0.1, 0.2, 0.3])) for body in robot.body_names[::5]]
    kinematics = BatchedKinematics(robot, points)
    base, rotation, joints = split(random_configurations(robot, 3, seed=2))
    rng = np.random.default_rng(3)
    forces = rng.normal(size=(3, len(points), 3))

    def value(db: np.ndarray, dw: np.ndarray, dq: np.ndarray) -> float:
        turned = Rotation.from_rotvec(dw).as_matrix() @ rotation
        return float((kinematics.place(base + db, turned, joints + dq).points * forces).sum())

    gradients = kinematics.gradient(kinematics.place(base, rotation, joints), forces)
    zeros = [np.zeros_like(g) for g in gradients]
    step = 1e-6
    for which, gradient in enumerate(gradients):
        for index in np.ndindex(gradient.shape):
            moved = [z.copy() for z in zeros]
            moved[which][index] = step
            up = value(*moved)
            moved[which][index] = -step
            assert gradient[index] == pytest.approx((up - value(*moved)) / (2 * step), abs=2e-8), (which, index)


def test_the_left_jacobian_by_finite_differences():
    rng = np.random.default_rng(4)
    w = np.concatenate([rng.normal(size=(5, 3)), rng.normal(size=(3, 3)) * 1e-6, np.zeros((1, 3))])
    step = 1e-6
    jacobian = left_jacobian(w)
    for axis in range(3):
        d = step * np.eye(3)[axis]
        difference = Rotation.from_rotvec(w + d) * Rotation.from_rotvec(w - d).inv()
        np.testing.assert_allclose(difference.as_rotvec() / (2 * step), jacobian[:, :, axis], atol=1e-9)


def test_a_body_that_is_not_there(g1):
    with pytest.raises(RobotError, match="no body 'tail'"):
        BatchedKinematics(g1, [("tail", np.zeros(3))])
