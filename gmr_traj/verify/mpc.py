"""Model-predictive control by Gauss-Newton on finite differences of rollouts.

The targets of the reference (with feed-forward) are corrected by a spline u of offsets of the legs' and the waist's
joints, linear between a few knots over the horizon.  Every plan rolls the robot out once for each perturbed knot value
(``mujoco.rollout``), differences the residuals r of the rollouts and takes a Levenberg-Marquardt step

    (J J' + R + lambda I) du = -(J r + R u)

of which several lengths are rolled out and the best is kept; no offset at all is among them.  There are no random
numbers, and every rollout is on its own, so the result does not depend on the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import rollout

from gmr_traj.robot import Robot
from gmr_traj.verify.controller import Controller, feed_forward
from gmr_traj.verify.reference import GRID, STRIDE, Reference
from gmr_traj.verify.residuals import Residuals
from gmr_traj.verify.simulated_robot import described_motors, simulation_model

_STEPS = (1.0, 0.6, 0.3, 0.1)  # of the Levenberg-Marquardt step; the old plan and no offset are tried beside them
_FULL = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)


@dataclass(frozen=True)
class Preset:
    """Numbers of the controller.

    Attributes:
        name: ``A`` or ``B``.
        replan: control ticks between plans.
        knots: times of the spline's knots from now, a multiple of 10 ms each [s].
        perturbation: of a knot's value for the differences [rad].
        damping: lambda.
        effort: weight R of the offsets, the same for all.
    """

    name: str
    replan: int
    knots: tuple[float, ...] = (0.0, 0.06, 0.16, 0.36, 0.72)
    perturbation: float = 0.01
    damping: float = 1.0
    effort: float = 2.0


PRESETS = {"A": Preset("A", replan=4), "B": Preset("B", replan=2)}


class Mpc(Controller):
    """The controller.

    Args:
        robot: the robot.
        preset: its numbers.
        threads: of the rollouts; the result is the same for any number.
    """

    def __init__(self, robot: Robot, preset: Preset, threads: int = 1) -> None:
        self.name = f"mpc {preset.name}"
        self._preset = preset
        self._model = simulation_model(
            robot,
            described_motors(robot),
            step=GRID,
            friction=0.8,
            point_feet=True,
            solver_iterations=8,  # with 3 or fewer, steps of 10 ms explode
            line_search_iterations=8,
        )
        self._data = [mujoco.MjData(self._model) for _ in range(threads)]
        self._corrected = correcting_joints(robot)
        self._knots = np.array([round(time / GRID) for time in preset.knots])
        steps = int(self._knots[-1])
        self._basis = hats(self._knots, np.arange(steps) // STRIDE * STRIDE)  # (steps, knots)
        self._residuals = Residuals(robot)

    def start(self, reference: Reference, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Begin a rollout."""
        self._reference = reference
        self._targets = feed_forward(reference)
        self._offsets = np.zeros((len(self._knots), len(self._corrected)))
        self._planned = 0

    def target(self, tick: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Joint targets of the tick, after a new plan where one is due."""
        if tick == 0 or tick - self._planned >= self._preset.replan:
            past = (tick - self._planned) * STRIDE
            self._offsets = hats(self._knots, np.minimum(self._knots + past, self._knots[-1])) @ self._offsets
            self._planned = tick
            self._plan(tick * STRIDE, qpos, qvel)
        row = (tick - self._planned) * STRIDE
        target = self._targets[min(tick * STRIDE, len(self._targets) - 1)].copy()
        target[self._corrected] += self._basis[row] @ self._offsets
        return np.asarray(target)

    def _plan(self, row: int, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Improve the offsets from a state at a row of the reference."""
        preset, size = self._preset, self._offsets.size
        horizon = Horizon(self, row, qpos, qvel)
        u = self._offsets.ravel()
        r, J = self._linearised(horizon)
        H = J @ J.T
        H.flat[:: size + 1] += preset.effort + preset.damping
        step = -np.linalg.solve(H, J @ r + preset.effort * u)
        tried = np.stack([u + length * step for length in _STEPS] + [np.zeros(size)])
        found = horizon.residuals(horizon.roll(tried.reshape(-1, *self._offsets.shape)))
        costs = [cost(own, offsets, preset) for own, offsets in zip((r, *found), (u, *tried), strict=True)]
        best = int(np.argmin(costs))
        if best > 0:
            self._offsets = tried[best - 1].reshape(self._offsets.shape)

    def _linearised(self, horizon: Horizon) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the present offsets  # (rows,), and their differences by each offset  # (knots m, rows).

        A knot moves nothing before the knot in front of it, so its rollouts begin there, on the way of the unperturbed
        one; that is rolled out beside them, so that both know equally little of the solver's last forces.
        """
        count, width = self._offsets.shape
        epsilon = self._preset.perturbation
        starts = [0, *self._knots[:-1].tolist()]
        way = np.empty(0)
        slopes: list[np.ndarray] = []
        r = np.empty(0)
        for first in sorted(set(starts)):
            own = [k for k in range(count) if starts[k] == first]
            offsets = np.repeat(self._offsets[None], 1 + len(own) * width, axis=0)
            for i, k in enumerate(own):
                offsets[1 + i * width + np.arange(width), k, np.arange(width)] += epsilon
            states = horizon.roll(offsets, first, way[first - 1] if first else None)
            found = horizon.residuals(states, first)
            if first == 0:
                way, r = states[0], found[0]
            part = np.zeros((len(own) * width, len(r)))
            part[:, len(r) - found.shape[1] :] = (found[1:] - found[0]) / epsilon
            slopes.append(part)
        return r, np.concatenate(slopes)


class Horizon:
    """Rollouts of one plan.

    Args:
        owner: the controller.
        row: row of the reference at which the plan begins.
        qpos: configuration there.  # (7 + n,)
        qvel: velocity there.  # (6 + n,)
    """

    def __init__(self, owner: Mpc, row: int, qpos: np.ndarray, qvel: np.ndarray) -> None:
        self._owner, targets = owner, owner._targets
        steps, last = len(owner._basis), len(targets) - 1
        self._base = targets[np.minimum(row + np.arange(steps) // STRIDE * STRIDE, last)]  # (steps, n)
        scratch = owner._data[0]
        mujoco.mj_resetData(owner._model, scratch)
        scratch.qpos[:], scratch.qvel[:] = qpos, qvel
        self._state = np.empty(mujoco.mj_stateSize(owner._model, _FULL))
        mujoco.mj_getState(owner._model, scratch, self._state, _FULL)
        rows = np.minimum(row + 1 + np.arange(steps), last)
        self._goal = owner._residuals.goal(owner._reference, rows)

    def roll(self, offsets: np.ndarray, first: int = 0, state: np.ndarray | None = None) -> np.ndarray:
        """States of rollouts with offsets (B, knots, m), from a step and the state before it.  # (B, steps, size)"""
        owner = self._owner
        control = np.repeat(self._base[None, first:], len(offsets), axis=0)
        control[:, :, owner._corrected] += np.einsum("sk,bkm->bsm", owner._basis[first:], offsets)
        begin = np.repeat((self._state if state is None else state)[None], len(offsets), axis=0)
        states, _ = rollout.rollout(owner._model, owner._data, begin, control)
        return np.asarray(states)

    def residuals(self, states: np.ndarray, first: int = 0) -> np.ndarray:
        """Residuals of rollouts that began at a step.  # (B, rows)"""
        return self._owner._residuals.of(states[:, :, 1:], self._goal.after(first))


def cost(r: np.ndarray, u: np.ndarray, preset: Preset) -> float:
    """|r|^2 + R |u|^2; infinite where a rollout diverged."""
    value = float(r @ r + preset.effort * (u @ u))
    return value if np.isfinite(value) else float("inf")


def hats(knots: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Weights of the knots in a function that is linear between them, at some times.  # (times, knots)"""
    return np.stack([np.interp(times, knots, own) for own in np.eye(len(knots))], axis=1)


def correcting_joints(robot: Robot) -> np.ndarray:
    """Joints between the base and the soles, and between the base and the anchor body: legs and waist."""
    model = robot.model
    found: set[int] = set()
    for name in (robot.anchor_body, *(sole.body for sole in robot.soles)):
        body = model.body(name).id
        while body > 1:
            if model.body_jntnum[body]:
                found.add(int(model.body_jntadr[body]) - 1)
            body = int(model.body_parentid[body])
    return np.array(sorted(found))
