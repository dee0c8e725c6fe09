"""The audit before and after, and the warning where it gets worse."""

from __future__ import annotations

import numpy as np

from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.verify.physics_change import physics_change


def still(robot: Robot, height: float) -> RobotMotion:
    qpos = np.tile(robot.nominal, (20, 1))
    qpos[:, 2] += height
    return RobotMotion(qpos, 30.0, robot.joint_names)


def test_worse_is_said(g1: Robot) -> None:
    found = physics_change(still(g1, 0.0), still(g1, 0.1), g1, 0.0)
    figures = {figure.name: figure for figure in found.figures}
    share = figures["frames that nothing can make follow physics"]
    assert share.before == 0.0 and share.after == 100.0 and share.worse
    assert any("100 %" in warning and "--save-contacts" in warning for warning in found.warnings)
    assert found.to_json()["warnings"] == list(found.warnings)
    assert found.to_json()["after"]["residual_force_mean"] > 0.9


def test_the_input_is_judged_on_the_floor(g1: Robot) -> None:
    found = physics_change(still(g1, 0.1), still(g1, 0.0), g1, -0.1)
    assert not found.warnings
    assert found.to_json()["before"]["infeasible_share"] == 0.0
