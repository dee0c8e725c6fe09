"""What the controller knows of the state when it sees it through sensors."""

from __future__ import annotations

from collections import deque

import mujoco
import numpy as np

from gmr_traj.verify.conditions import Sensing
from gmr_traj.verify.reference import CONTROL


class Estimator:
    """A filter that blends late and noisy measurements into the predictions of a model.

    With x the estimate of the tick that was measured, y the measurement and P one tick of the model under the targets
    that were held,

        x <- P(x) + blend (y - P(x)),     estimate for now = P applied ``latency`` times to x

    Differences of orientations are rotation vectors.  Raw noisy states make a predictive controller fall; the blend
    keeps the plan and the state together.

    Args:
        model: the robot as the controller believes it to be.
        sensing: noise, latency and blend.
        rng: where the noise comes from.
    """

    def __init__(self, model: mujoco.MjModel, sensing: Sensing, rng: np.random.Generator) -> None:
        self._model, self._data, self._sensing, self._rng = model, mujoco.MjData(model), sensing, rng
        self._steps = max(1, round(CONTROL / model.opt.timestep))
        n = model.nu
        s = sensing
        self._q_noise = np.repeat([s.position, s.orientation, s.joint_position], [3, 3, n])
        self._v_noise = np.repeat([s.linear_velocity, s.angular_velocity, s.joint_velocity], [3, 3, n])
        self._measured: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=sensing.latency + 1)
        self._held: deque[np.ndarray] = deque(maxlen=sensing.latency + 1)
        self._x: tuple[np.ndarray, np.ndarray] | None = None

    def update(self, qpos: np.ndarray, qvel: np.ndarray, held: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """The estimate of the present configuration and velocity.

        Args:
            qpos: the true configuration, which is measured now.  # (7 + n,)
            qvel: the true velocity.  # (6 + n,)
            held: the targets since the last tick; None at the first.
        """
        self._measured.append(self._measure(qpos, qvel))
        if held is not None:
            self._held.append(held)
        late = len(self._measured) == self._measured.maxlen
        if self._x is None:
            self._x = self._measured[0]
        elif late and len(self._held) == self._held.maxlen:
            self._x = self._blend(self._predict(self._x, self._held[0]), self._measured[0])
        now = self._x
        # The targets that were held since what is estimated was measured.
        pending = list(self._held)[1:] if len(self._held) == self._held.maxlen else list(self._held)
        for target in pending:
            now = self._predict(now, target)
        return now

    def _measure(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q = qpos.copy()
        mujoco.mj_integratePos(self._model, q, self._rng.uniform(-1.0, 1.0, len(self._q_noise)) * self._q_noise, 1.0)
        return q, qvel + self._rng.uniform(-1.0, 1.0, len(self._v_noise)) * self._v_noise

    def _predict(self, state: tuple[np.ndarray, np.ndarray], target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = state
        self._data.ctrl[:] = target
        for _ in range(self._steps):
            mujoco.mj_step(self._model, self._data)
        return self._data.qpos.copy(), self._data.qvel.copy()

    def _blend(
        self, expected: tuple[np.ndarray, np.ndarray], measured: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        q, off = expected[0].copy(), np.empty(self._model.nv)
        mujoco.mj_differentiatePos(self._model, off, 1.0, expected[0], measured[0])
        mujoco.mj_integratePos(self._model, q, off, self._sensing.blend)
        return q, expected[1] + self._sensing.blend * (measured[1] - expected[1])
