"""What differs from trial to trial: the plant, the zero positions of its joints, and pushes."""

from __future__ import annotations

import mujoco
import numpy as np

from gmr_traj.robot import Robot
from gmr_traj.verify.conditions import Randomisation


class Disturbance:
    """The draws of one trial.

    Args:
        robot: the robot.
        randomise: the ranges.
        rng: where the draws come from.
    """

    def __init__(self, robot: Robot, randomise: Randomisation, rng: np.random.Generator) -> None:
        self._robot, self._ranges, self._rng = robot, randomise, rng
        self.friction = float(rng.uniform(*randomise.friction))
        self.mass = 1.0 + float(rng.uniform(-randomise.mass, randomise.mass))
        self.com = rng.uniform(-1.0, 1.0, 3) * randomise.anchor_com
        self.joint_offset = rng.uniform(-1.0, 1.0, robot.dof) * randomise.joint_offset
        self._next = float(rng.uniform(*randomise.push_every))

    def change(self, model: mujoco.MjModel) -> None:
        """Make a plant's model this trial's."""
        model.geom_friction[:, 0] = self.friction
        model.body_mass[:] *= self.mass
        model.body_inertia[:] *= self.mass
        model.body_ipos[model.body(self._robot.anchor_body).id] += self.com
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def push(self, data: mujoco.MjData, time: float) -> None:
        """Push the base where the time has come."""
        if time < self._next:
            return
        self._next = time + float(self._rng.uniform(*self._ranges.push_every))
        data.qvel[:3] += self._rng.uniform(-1.0, 1.0, 3) * self._ranges.push_linear
        data.qvel[3:6] += self._rng.uniform(-1.0, 1.0, 3) * self._ranges.push_angular
