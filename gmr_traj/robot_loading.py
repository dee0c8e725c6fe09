"""Loading a robot: its robot.toml held against its compiled model."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path

import mujoco
import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import RobotError
from gmr_traj.robot import Capsule, KeyBody, Robot
from gmr_traj.robot_model import compile_spec, load_spec
from gmr_traj.robot_shapes import collision_pairs, model_capsules
from gmr_traj.robot_toml import RobotFile, read_robot_toml


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot.

    Args:
        name_or_path: a robot that ships with gmr-traj (``unitree_g1``), or the path of a robot.toml or of a folder with one.

    Raises:
        ResourceError: there is no such robot.
        RobotError: its robot.toml or its model is incomplete, wrong, or they contradict each other.
    """
    path = resources.find("models", name_or_path)
    if path.is_dir():
        path = path / "robot.toml"
    if path.suffix != ".toml":
        raise RobotError(f"{path}: expected a robot.toml, which names the model file; see models/unitree_g1/robot.toml")
    return _build(read_robot_toml(path), None)


def reduce_robot(robot: Robot, joint_names: tuple[str, ...]) -> Robot:
    """The same robot with all other joints locked at zero.

    Bodies stay, with their names; every joint array, capsule and pair follows.  Joints keep the model's order,
    whatever the order of ``joint_names``.

    Raises:
        RobotError: a name is not a joint of the robot.
    """
    unknown = [n for n in joint_names if n not in robot.joint_names]
    if unknown:
        raise RobotError(f"robot {robot.name} has no joint {unknown[0]!r}; it has {', '.join(robot.joint_names)}")
    return _build(read_robot_toml(robot.path), frozenset(joint_names))


def _build(file: RobotFile, keep: frozenset[str] | None) -> Robot:
    spec = load_spec(file)
    full = compile_spec(spec, file)
    _check_patterns(file, full)
    if keep is not None:
        for joint in [j for b in spec.bodies[2:] for j in b.joints]:
            if joint.name not in keep:
                spec.delete(joint)
    model = compile_spec(spec, file)
    joints = tuple(model.joint(j).name for j in range(1, model.njnt))
    bodies = tuple(model.body(b).name for b in range(1, model.nbody))
    lower, upper = _ranges(file, model)
    figures = [next(f for f in file.joints if _matches(name, f.patterns)) for name in joints]
    column = {key: _frozen([getattr(f, key) for f in figures]) for key in ("velocity", "acceleration", "effort", "stiffness", "damping")}
    capsules = _capsules(file, model)
    nominal = _nominal(file, model, joints, lower, upper)
    zero = nominal.copy()
    zero[7:] = 0.0
    return Robot(
        name=file.name,
        path=file.path,
        model=model,
        joint_names=joints,
        body_names=bodies,
        position_lower=lower,
        position_upper=upper,
        velocity_limit=column["velocity"],
        acceleration_limit=column["acceleration"],
        effort_limit=column["effort"],
        stiffness=column["stiffness"],
        damping=column["damping"],
        nominal=nominal,
        anchor_body=_body(file, bodies, file.anchor_body, "anchor_body"),
        key_bodies=_key_bodies(file, bodies),
        soles=tuple(s for s in file.soles if _body(file, bodies, s.body, f"[[soles]] {s.name}")),
        capsules=capsules,
        collision_pairs=collision_pairs(file, model, capsules, np.stack([zero, nominal])),
    )


def _check_patterns(file: RobotFile, model: mujoco.MjModel) -> None:
    """Every joint has exactly one [[joints]] entry, every name in the file means a joint of the model."""
    names = [model.joint(j).name for j in range(1, model.njnt)]
    for name in names:
        entries = [i + 1 for i, f in enumerate(file.joints) if _matches(name, f.patterns)]
        if len(entries) != 1:
            raise RobotError(f"{file.path}: joint {name!r} of {file.model.name} is in {len(entries)} [[joints]] entries; expected one")
    for where, pattern in [("[[joints]]", p) for f in file.joints for p in f.patterns] + [("[nominal]", p) for p in file.nominal]:
        if not any(fnmatchcase(n, pattern) for n in names):
            raise RobotError(f"{file.path}: {where} {pattern!r} is no joint of {file.model.name}; it has {', '.join(names)}")


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, p) for p in patterns)


def _ranges(file: RobotFile, model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    for j in range(1, model.njnt):
        low, high = model.jnt_range[j]
        if not int(model.jnt_limited[j]) or not low < high:
            raise RobotError(f"{file.model}: joint {model.joint(j).name!r} has no range; every joint needs a lower and an upper limit")
    return _frozen(model.jnt_range[1:, 0]), _frozen(model.jnt_range[1:, 1])


def _body(file: RobotFile, bodies: tuple[str, ...], name: str, where: str) -> str:
    if name not in bodies:
        raise RobotError(f"{file.path}: {where}: {name!r} is no body of {file.model.name}; it has {', '.join(bodies)}")
    return name


def _key_bodies(file: RobotFile, bodies: tuple[str, ...]) -> tuple[KeyBody, ...]:
    chosen: dict[str, KeyBody] = {}
    for figures in file.key_bodies:
        for pattern in figures.patterns:
            found = [b for b in bodies if fnmatchcase(b, pattern)]
            if not found:
                _body(file, bodies, pattern, "[[key_bodies]]")
            for name in found:
                if name in chosen:
                    raise RobotError(f"{file.path}: body {name!r} is in two [[key_bodies]] entries; expected one")
                chosen[name] = KeyBody(name, figures.position_weight, figures.orientation_weight)
    return tuple(chosen[b] for b in bodies if b in chosen)


def _capsules(file: RobotFile, model: mujoco.MjModel) -> tuple[Capsule, ...]:
    """Shapes listed in robot.toml replace the model's own shapes of their bodies."""
    bodies = tuple(model.body(b).name for b in range(1, model.nbody))
    listed = {_body(file, bodies, c.body, f"[[capsules]] {c.name}") for c in file.capsules}
    capsules = tuple(c for c in model_capsules(model) if c.body not in listed) + file.capsules
    names = [c.name for c in capsules]
    if len(set(names)) != len(names):
        raise RobotError(f"{file.path}: two collision shapes have the name {next(n for n in names if names.count(n) > 1)!r}")
    for pair in file.ignored_pairs:
        for name in pair.bodies:
            _body(file, bodies, name, "[[collision.ignore]]")
    return capsules


def _nominal(file: RobotFile, model: mujoco.MjModel, joints: tuple[str, ...], lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The nominal joint positions with an upright base so high that the lowest sole point is on the floor."""
    q = np.zeros(model.nq)
    q[3] = 1.0
    for i, name in enumerate(joints):
        values = [v for pattern, v in file.nominal.items() if fnmatchcase(name, pattern)]
        if len(values) > 1:
            raise RobotError(f"{file.path}: [nominal] gives joint {name!r} {len(values)} values; expected one")
        q[7 + i] = values[0] if values else 0.0
        if not lower[i] <= q[7 + i] <= upper[i]:
            raise RobotError(f"{file.path}: [nominal] {name} = {q[7 + i]:g} is outside its range {lower[i]:g} .. {upper[i]:g}")
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    heights = [data.body(s.body).xpos[2] + (s.points @ data.body(s.body).xmat.reshape(3, 3).T)[:, 2] for s in file.soles]
    q[2] = -min(h.min() for h in heights)
    return _frozen(q)


def _frozen(values: object) -> np.ndarray:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array
