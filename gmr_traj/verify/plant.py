"""The plant: the simulated robot, stepped between control ticks."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from gmr_traj.kinematics.mujoco_kinematics import to_mujoco
from gmr_traj.verify.reference import CONTROL

_WILD = 100.0  # [rad/s], [m/s] no humanoid moves like this: the simulation has diverged


class Plant:
    """A model with its state, driven by joint targets that are held between control ticks.

    Attributes:
        diverged: whether the simulation has gone out of bounds; it then stands still.
        saturated: whether a motor was at its effort limit during the last tick.
        over_speed: whether a joint was above its velocity limit during the last tick.

    Args:
        model: from ``simulation_model``; it is changed while it runs, so it must be the plant's own.
        velocity_limit: a motor gives no torque that would make its joint faster than this [rad/s].  # (n,)
    """

    def __init__(self, model: mujoco.MjModel, velocity_limit: np.ndarray) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self._velocity_limit = velocity_limit
        self._effort = np.array(model.actuator_forcerange)
        self._steps = max(1, round(CONTROL / model.opt.timestep))
        self.diverged = self.saturated = self.over_speed = False

    def reset(self, q: np.ndarray, v: np.ndarray) -> None:
        """Start at a configuration and a velocity (world axes)."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, to_mujoco(q, v)
        mujoco.mj_forward(self.model, self.data)
        self.diverged = self.saturated = self.over_speed = False

    def contact_forces(self, bodies: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """What the floor does to some bodies now.

        Args:
            bodies: ids of the model's bodies.  # B

        Returns:
            the points where the floor's forces act in the mean, weighted with them [m], and their sums [N], both in the
            world; a body that does not touch has its origin and zero.  # (B, 3), (B, 3)
        """
        place = {body: k for k, body in enumerate(bodies)}
        points, forces = np.array(self.data.xpos[list(bodies)]), np.zeros((len(bodies), 3))
        moments, weights = np.zeros_like(forces), np.zeros(len(bodies))
        wrench = np.zeros(6)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            one, two = (int(self.model.geom_bodyid[geom]) for geom in contact.geom)
            if (one == 0) == (two == 0):
                continue  # robot against robot
            mujoco.mj_contactForce(self.model, self.data, k, wrench)
            # The force is on the second geom, in the contact's frame, whose axes are the rows of ``frame``.
            force = (1.0 if one == 0 else -1.0) * (contact.frame.reshape(3, 3).T @ wrench[:3])
            b, size = place[two if one == 0 else one], float(np.linalg.norm(wrench[:3]))
            forces[b] += force
            moments[b] += size * contact.pos
            weights[b] += size
        touching = weights > 0
        points[touching] = moments[touching] / weights[touching, None]
        return points, forces

    def advance(self, target: np.ndarray) -> None:
        """Hold joint targets  # (n,) for one control tick; where the simulation diverges, ``diverged`` is set."""
        if self.diverged or not np.isfinite(target).all():
            self.diverged = True
            return
        data = self.data
        data.ctrl[:] = target
        self.saturated = self.over_speed = False
        for _ in range(self._steps):
            speed = data.qvel[6:]
            limits = self.model.actuator_forcerange
            limits[:, 0] = np.where(speed < -self._velocity_limit, 0.0, self._effort[:, 0])
            limits[:, 1] = np.where(speed > self._velocity_limit, 0.0, self._effort[:, 1])
            self.over_speed |= bool((np.abs(speed) > self._velocity_limit).any())
            mujoco.mj_step(self.model, data)
            self.saturated |= bool((np.abs(data.actuator_force) >= self._effort[:, 1] - 1e-9).any())
            # MuJoCo starts again from its reset state where numbers explode; that would look like a robot that stands.
            if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or np.abs(data.qvel).max() > _WILD:
                self.diverged = True
                return
        if any(
            data.warning[kind].number for kind in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL)
        ):
            self.diverged = True
