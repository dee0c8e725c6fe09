"""Loading a robot: its robot.toml held against its compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import mujoco
import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule, KeyBody, Robot
from gmr_traj.robot_model import compile_model
from gmr_traj.robot_pairs import collision_pairs
from gmr_traj.robot_shapes import model_capsules
from gmr_traj.robot_standing import check_floor, standing_configuration
from gmr_traj.robot_supports import body_supports
from gmr_traj.robot_toml import JointFigures, RobotFile, read_robot_toml


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot.

    Args:
        name_or_path: a robot that ships with gmr-traj (``unitree_g1``), or the path of a robot.toml or its folder.

    Raises:
        ResourceError: there is no such robot.
        RobotError: its robot.toml or its model is incomplete, wrong, or they contradict each other.
    """
    path = resources.find("models", name_or_path)
    if path.is_dir():
        path = path / "robot.toml"
    if path.suffix != ".toml":
        raise RobotError(f"{path}: expected a robot.toml, which names the model file and gives the figures beside it")
    return _build(read_robot_toml(path), None)


def reduce_robot(robot: Robot, joint_names: Sequence[str]) -> Robot:
    """The same robot with all other joints locked at zero.

    Bodies stay, with their names; every joint array, capsule and pair follows.  The joints keep the model's order,
    whatever the order of ``joint_names``.

    Args:
        robot: a robot that was loaded from a file.
        joint_names: joints to keep.

    Raises:
        RobotError: a name is not a joint of the robot, or none is left.
    """
    unknown = [name for name in joint_names if name not in robot.joint_names]
    if unknown:
        raise RobotError(f"robot {robot.name} has no joint {unknown[0]!r}; it has {', '.join(robot.joint_names)}")
    return _build(read_robot_toml(robot.path), frozenset(joint_names))


def _build(file: RobotFile, keep: frozenset[str] | None) -> Robot:
    full_model = compile_model(file)
    names = _joint_names(full_model)
    figures = _joint_figures(file, names)
    nominal_values = _nominal_values(file, names)
    model = full_model if keep is None else compile_model(file, keep)
    joints = _joint_names(model)
    bodies = tuple(model.body(b).name for b in range(1, model.nbody))
    capsules = _capsules(file, model, bodies)
    for sole in file.soles:
        _body(file, bodies, sole.body, f"[[soles]] {sole.name!r}")
    nominal = standing_configuration(file, model, [nominal_values[name] for name in joints])
    check_floor(file, model, capsules, nominal)
    zero = np.concatenate([nominal[:7], np.zeros(len(joints))])
    configurations = np.stack([zero, nominal])
    return Robot(
        name=file.name,
        path=file.path,
        model=model,
        joint_names=joints,
        body_names=bodies,
        position_lower=_frozen(model.jnt_range[1:, 0]),
        position_upper=_frozen(model.jnt_range[1:, 1]),
        velocity_limit=_frozen([figures[name].velocity for name in joints]),
        acceleration_limit=_frozen([figures[name].acceleration for name in joints]),
        effort_limit=_frozen([figures[name].effort for name in joints]),
        stiffness=_frozen([figures[name].stiffness for name in joints]),
        damping=_frozen([figures[name].damping for name in joints]),
        nominal=nominal,
        anchor_body=_body(file, bodies, file.anchor_body, "anchor_body"),
        key_bodies=_key_bodies(file, bodies),
        soles=file.soles,
        capsules=capsules,
        collision_pairs=collision_pairs(
            model, full_model, capsules, file.ignore_within_joints, file.ignored_pairs, configurations
        ),
        supports=body_supports(file, capsules),
    )


def _joint_names(model: mujoco.MjModel) -> tuple[str, ...]:
    return tuple(model.joint(j).name for j in range(1, model.njnt))


def _joint_figures(file: RobotFile, names: tuple[str, ...]) -> dict[str, JointFigures]:
    """The one [[joints]] entry of every joint."""
    for pattern in (p for entry in file.joints for p in entry.patterns):
        _check_pattern(file, names, pattern, "[[joints]]")
    out = {}
    for name in names:
        entries = [entry for entry in file.joints if any(fnmatchcase(name, p) for p in entry.patterns)]
        if len(entries) != 1:
            raise RobotError(f"{file.path}: joint {name!r} is in {len(entries)} [[joints]] entries; expected one")
        out[name] = entries[0]
    return out


def _nominal_values(file: RobotFile, names: tuple[str, ...]) -> dict[str, float]:
    """The nominal position of every joint [rad]."""
    for pattern in file.nominal:
        _check_pattern(file, names, pattern, "[nominal]")
    out = {}
    for name in names:
        values = [value for pattern, value in file.nominal.items() if fnmatchcase(name, pattern)]
        if len(values) > 1:
            raise RobotError(f"{file.path}: [nominal] gives joint {name!r} {len(values)} values; expected one")
        out[name] = values[0] if values else 0.0
    return out


def _check_pattern(file: RobotFile, names: tuple[str, ...], pattern: str, where: str) -> None:
    if not any(fnmatchcase(name, pattern) for name in names):
        known = ", ".join(names)
        raise RobotError(f"{file.path}: {where} {pattern!r} is no joint of {file.model.name}; it has {known}")


def _body(file: RobotFile, bodies: tuple[str, ...], name: str, where: str) -> str:
    if name not in bodies:
        raise RobotError(f"{file.path}: {where}: {name!r} is no body of {file.model.name}; it has {', '.join(bodies)}")
    return name


def _key_bodies(file: RobotFile, bodies: tuple[str, ...]) -> tuple[KeyBody, ...]:
    chosen: dict[str, KeyBody] = {}
    for entry in file.key_bodies:
        for pattern in entry.patterns:
            found = [b for b in bodies if fnmatchcase(b, pattern)] or [_body(file, bodies, pattern, "[[key_bodies]]")]
            for name in found:
                if name in chosen:
                    raise RobotError(f"{file.path}: body {name!r} is in [[key_bodies]] twice; expected once")
                chosen[name] = KeyBody(name, entry.position_weight, entry.orientation_weight)
    return tuple(chosen[b] for b in bodies if b in chosen)


def _capsules(file: RobotFile, model: mujoco.MjModel, bodies: tuple[str, ...]) -> tuple[Capsule, ...]:
    """Shapes listed in robot.toml, which replace the model's own shapes of their bodies, after the model's."""
    listed = {_body(file, bodies, capsule.body, f"[[capsules]] {capsule.name!r}") for capsule in file.capsules}
    capsules = tuple(c for c in model_capsules(model) if c.body not in listed) + file.capsules
    names = [c.name for c in capsules]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise RobotError(f"{file.path}: two collision shapes have the name {twice[0]!r}; names must differ")
    for name in (name for pair in file.ignored_pairs for name in pair.bodies):
        _body(file, bodies, name, "[[collision.ignore]]")
    return capsules


def _frozen(values: object) -> np.ndarray:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array
