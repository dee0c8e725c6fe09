"""The robot as MuJoCo simulates it: its shapes, a floor, and PD motors with limited torque."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from gmr_traj.robot import Robot
from gmr_traj.robot_model import model_spec
from gmr_traj.robot_toml import read_robot_toml

FLOOR = "verify_floor"
_FEET_PREFIX = "verify_sole"


@dataclass(frozen=True)
class Motors:
    """PD motors, ``torque = kp (target - q) - kd q'`` within the effort limits.

    Attributes:
        stiffness, damping: kp, kd [N m/rad], [N m s/rad].  # (n,)
        armature: reflected inertia of the rotors [kg m^2].  # (n,)
        effort: largest torque [N m].  # (n,)
        velocity: a motor gives no torque that would make its joint faster than this [rad/s].  # (n,)
    """

    stiffness: np.ndarray
    damping: np.ndarray
    armature: np.ndarray
    effort: np.ndarray
    velocity: np.ndarray


def described_motors(robot: Robot) -> Motors:
    """The motors that robot.toml and the model describe."""
    armature = np.array(robot.model.dof_armature[6:])
    return Motors(robot.stiffness, robot.damping, armature, robot.effort_limit, robot.velocity_limit)


def simulation_model(
    robot: Robot,
    drive: Motors,
    *,
    step: float,
    friction: float,
    point_feet: bool = False,
    self_collision: bool = False,
    contact_time: float = 0.02,
    solver_iterations: int = 50,
    line_search_iterations: int = 50,
) -> mujoco.MjModel:
    """Compile the robot with a floor at z = 0 and a PD motor on every joint, whose control is the target angle.

    Shapes are capsules as in ``robot.capsules``, whether they come from the model file or from robot.toml.

    Args:
        robot: the robot.
        drive: its motors.
        step: simulation step [s].
        friction: coefficient of friction of floor and robot [-].
        point_feet: four spheres of 1 cm under each sole instead of the feet's shapes (cheaper, for planning).
        self_collision: the pairs of ``robot.collision_pairs`` collide.
        contact_time: time constant of contacts [s].
        solver_iterations: limit of MuJoCo's constraint solver.
        line_search_iterations: limit of its line search.
    """
    file = read_robot_toml(robot.path)
    spec = model_spec(file, frozenset(robot.joint_names))
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.iterations = solver_iterations
    spec.option.ls_iterations = line_search_iterations
    for geom in list(spec.geoms):
        spec.delete(geom)
    feet = {sole.body for sole in robot.soles}
    surface = {"friction": [friction, 0.005, 0.0001], "solref": [contact_time, 1.0], "condim": 3}
    for capsule in robot.capsules:
        if point_feet and capsule.body in feet:
            continue
        shape = _shape(capsule.start, capsule.end, capsule.radius)
        spec.body(capsule.body).add_geom(name=capsule.name, contype=0, conaffinity=1, mass=0.0, **shape, **surface)
    if point_feet:
        for sole in robot.soles:
            for k, point in enumerate(sole.points):
                shape = _shape(point + [0.0, 0.0, 0.01], point + [0.0, 0.0, 0.01], 0.01)
                name = f"{_FEET_PREFIX}_{sole.name}_{k}"
                spec.body(sole.body).add_geom(name=name, contype=0, conaffinity=1, mass=0.0, **shape, **surface)
    plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0.0, 0.0, 0.05]}
    spec.worldbody.add_geom(name=FLOOR, contype=1, conaffinity=0, **plane, **surface)
    if self_collision:
        for i, j in robot.collision_pairs:
            names = {"geomname1": robot.capsules[i].name, "geomname2": robot.capsules[j].name}
            spec.add_pair(**names, friction=[friction, friction, 0.005, 0.0001, 0.0001], condim=1)
    for k, name in enumerate(robot.joint_names):
        spec.joint(name).armature = float(drive.armature[k])
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        kp, kd, limit = float(drive.stiffness[k]), float(drive.damping[k]), float(drive.effort[k])
        motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0], motor.biasprm[1], motor.biasprm[2] = kp, -kp, -kd
        motor.forcelimited, motor.forcerange = True, [-limit, limit]
    model = spec.compile()
    # Inertia comes from the robot as it was loaded, whatever its shapes weigh by themselves.
    model.body_mass[:], model.body_inertia[:] = robot.model.body_mass, robot.model.body_inertia
    model.body_ipos[:], model.body_iquat[:] = robot.model.body_ipos, robot.model.body_iquat
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _shape(start: np.ndarray, end: np.ndarray, radius: float) -> dict[str, object]:
    length = float(np.linalg.norm(end - start))
    if length < 1e-9:
        return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [radius, 0, 0], "pos": start}
    return {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": [radius, 0, 0], "fromto": np.concatenate([start, end])}
