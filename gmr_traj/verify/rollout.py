"""One rollout: a controller and a plant follow a reference until its end or a fall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from gmr_traj.exceptions import ClipError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.track import ContactForces
from gmr_traj.verify.conditions import Conditions, PlantSettings
from gmr_traj.verify.controller import Controller
from gmr_traj.verify.disturbance import Disturbance
from gmr_traj.verify.estimator import Estimator
from gmr_traj.verify.plant import Plant
from gmr_traj.verify.reference import CONTROL, GRID, Reference
from gmr_traj.verify.simulated_robot import Motors, simulation_model
from gmr_traj.verify.tracking import Rules, Tracking, tracking
from gmr_traj.verify.warnings_off import no_log_file

Start = Literal["clip", "default"]
# Largest speeds of the base to start with [m/s], [rad/s]: a jump of a clip's first frame is not a speed it comes with.
START_LINEAR, START_ANGULAR = 4.0, 8.0
_INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}


@dataclass(frozen=True)
class Rollout:
    """What became of one rollout.

    Attributes:
        controller: which one.
        tracking: how well it followed.
        motion: what the robot did, at 50 Hz until the end or the fall.
        forces: of the floor on the robot's bodies, in every frame of ``motion``.
    """

    controller: str
    tracking: Tracking
    motion: RobotMotion
    forces: ContactForces


@no_log_file()
def roll_out(
    reference: Reference,
    controller: Controller,
    conditions: Conditions,
    *,
    seed: int | tuple[int, ...] = 0,
    start: Start = "clip",
    progress: Callable[[int, int], None] | None = None,
) -> Rollout:
    """Simulate one trial.

    Args:
        reference: what to follow.
        controller: by which rule.
        conditions: the plant, what is random, what the controller sees.
        seed: of everything random.
        start: ``clip``: at the reference's first configuration with its velocity; ``default``: standing in the robot's
            nominal configuration where the clip begins, with its heading.
        progress: called with ticks done and ticks in all.

    Returns:
        The rollout.  A simulation that diverges is a fall.

    Raises:
        ClipError: the clip is shorter than one control tick.
    """
    robot = reference.robot
    if reference.ticks < 2:
        raise ClipError(f"there is nothing to follow: the clip is shorter than one control tick of {CONTROL:g} s")
    rng = np.random.default_rng(seed)
    drive = controller.motors(robot)
    model = plant_model(robot, drive, conditions.plant)
    disturbance = None
    if conditions.randomise is not None:
        disturbance = Disturbance(robot, conditions.randomise, rng)
        disturbance.change(model)
    offset = np.zeros(robot.dof) if disturbance is None else disturbance.joint_offset
    plant = Plant(model, drive.velocity)
    estimator = None
    if conditions.sensing is not None:
        believed = simulation_model(robot, drive, step=GRID, friction=0.8, point_feet=True)
        estimator = Estimator(believed, conditions.sensing, rng)
    plant.reset(*starting_state(reference, start))
    rules, held = Rules(robot), None
    bodies = [int(model.body(name).id) for name in robot.body_names]
    states, flags, reason = [plant.data.qpos.copy()], [(False, False)], ""
    touched = [plant.contact_forces(bodies)]
    for tick in range(reference.ticks - 1):
        if progress is not None:
            progress(tick, reference.ticks - 1)
        seen, speed = plant.data.qpos.copy(), plant.data.qvel.copy()
        seen[7:] += offset  # encoders whose zero is off: the motors' targets are off the other way
        if estimator is not None:
            seen, speed = estimator.update(seen, speed, held)
        if tick == 0:
            controller.start(reference, seen, speed)
        held = controller.target(tick, seen, speed)
        if disturbance is not None:
            disturbance.push(plant.data, tick * CONTROL)
        plant.advance(held - offset)
        wanted = reference.at(tick + 1)[0]
        positions, rotations = placements(robot, np.stack([plant.data.qpos, wanted]))
        reason = (
            "the simulation diverged"
            if plant.diverged
            else rules.broken(positions[0], rotations[0], positions[1], rotations[1])
        )
        if reason:
            break
        states.append(plant.data.qpos.copy())
        touched.append(plant.contact_forces(bodies))
        flags.append((plant.saturated, plant.over_speed))
    qpos, marks = np.array(states), np.array(flags)
    wanted = np.stack([reference.at(tick)[0] for tick in range(len(qpos))])
    followed = tracking(
        robot, qpos, wanted, tick=CONTROL, ticks=reference.ticks, reason=reason,
        saturated=marks[:, 0], over_speed=marks[:, 1],
    )  # fmt: skip
    motion = RobotMotion(qpos, 1.0 / CONTROL, robot.joint_names, robot.name)
    forces = ContactForces(*(np.stack(each) for each in zip(*touched, strict=True)))
    return Rollout(controller.name, followed, motion, forces)


def plant_model(robot: Robot, drive: Motors, settings: PlantSettings) -> mujoco.MjModel:
    """The model of the plant."""
    model = simulation_model(
        robot,
        drive,
        step=settings.step,
        friction=settings.friction,
        self_collision=settings.self_collision,
        contact_time=settings.contact_time,
    )
    model.opt.integrator = _INTEGRATORS[settings.integrator]
    return model


def starting_state(reference: Reference, start: Start) -> tuple[np.ndarray, np.ndarray]:
    """Configuration and velocity (world axes) with which a rollout begins, the latter within what is possible."""
    q, v = reference.at(0)
    if start == "clip":
        v, limit = v.copy(), reference.robot.velocity_limit
        for part, fastest in ((slice(0, 3), START_LINEAR), (slice(3, 6), START_ANGULAR)):
            v[part] *= min(1.0, fastest / max(float(np.linalg.norm(v[part])), 1e-9))
        v[6:] = np.clip(v[6:], -limit, limit)
        return q, v
    nominal = reference.robot.nominal.copy()
    nominal[:2] = q[:2]
    w, x, y, z = q[3:7]
    heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    nominal[3:7] = np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading)
    return nominal, np.zeros_like(v)
