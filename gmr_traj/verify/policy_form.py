"""What a policy of BeyondMimic's kind says of itself in its metadata: joints, gains, scales, order of observations.

Two ways of writing that are known:

- whole_body_tracking's and mjlab's: comma-separated texts named ``joint_names``, ``default_joint_pos``,
  ``joint_stiffness``, ``joint_damping``, ``action_scale``, ``anchor_body_name``, ``observation_names``;
- holosoma's: JSON named ``dof_names``, ``kp``, ``kd``, ``action_scale``, and ``experiment_config``, which has the
  default angles and says what an action is where ``action_scale`` does not.  Its observations are in the alphabetical
  order of holosoma's names for them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gmr_traj.exceptions import PolicyError
from gmr_traj.robot import Robot
from gmr_traj.verify.policy import Network

JOINTS = 29
# Widths of the observations, in the order that whole_body_tracking gives them.  # (160,)
WIDTH = {
    "command": 2 * JOINTS,
    "motion_anchor_pos_b": 3,
    "motion_anchor_ori_b": 6,
    "base_lin_vel": 3,
    "base_ang_vel": 3,
    "joint_pos": JOINTS,
    "joint_vel": JOINTS,
    "actions": JOINTS,
}
ESTIMATED = ("motion_anchor_pos_b", "base_lin_vel")  # which policies without state estimation lack
WIDTHS = (sum(WIDTH.values()) - 6, sum(WIDTH.values()))

_HOLOSOMA = {  # what holosoma calls the same
    "command": "motion_command",
    "motion_anchor_pos_b": "motion_ref_pos_b",
    "motion_anchor_ori_b": "motion_ref_ori_b",
    "joint_pos": "dof_pos",
    "joint_vel": "dof_vel",
}


@dataclass(frozen=True)
class PolicyForm:
    """The form of one policy; arrays in the order of its own joints.

    Attributes:
        joint_names: its joints.  # 29
        default: joint positions that an action of zero asks for [rad].  # (29,)
        scale: what an action of one adds to that [rad].  # (29,)
        stiffness, damping: of its motors [N m/rad], [N m s/rad].  # (29,)
        anchor: the anchor body.
        observations: names of ``WIDTH``, in the order of the network's input.
    """

    joint_names: tuple[str, ...]
    default: np.ndarray
    scale: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    anchor: str
    observations: tuple[str, ...]


def read_form(network: Network, robot: Robot) -> PolicyForm:
    """The form of a network with as many inputs as ``WIDTHS`` has.

    Raises:
        PolicyError: the metadata is missing or incomplete, or names joints, a body or observations that there are not.
    """
    form = _holosoma(network, robot) if "dof_names" in network.metadata else _whole_body_tracking(network, robot)
    for name, values in (("stiffness", form.stiffness), ("damping", form.damping)):
        if (values <= 0.0).any():
            raise PolicyError(f"{network.path}: {name} has {values.min():g}; gains must be above zero")
    if form.anchor not in robot.body_names:
        raise PolicyError(f"{network.path}: anchor_body_name is {form.anchor!r}, which is no body of {robot.name}")
    return form


def _whole_body_tracking(network: Network, robot: Robot) -> PolicyForm:
    names = _texts(network, "joint_names")
    _check_joints(network, robot, names)
    given = _texts(network, "observation_names") if "observation_names" in network.metadata else None
    return PolicyForm(
        joint_names=tuple(names),
        **{
            field: _numbers(network, key, _texts(network, key))
            for field, key in (
                ("default", "default_joint_pos"),
                ("scale", "action_scale"),
                ("stiffness", "joint_stiffness"),
                ("damping", "joint_damping"),
            )
        },
        anchor=network.metadata.get("anchor_body_name", robot.anchor_body),
        observations=_present(network) if given is None else _known(network, given),
    )


def _holosoma(network: Network, robot: Robot) -> PolicyForm:
    names = _json(network, "dof_names")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise PolicyError(f"{network.path}: dof_names in its metadata is {names!r}, not a list of names")
    _check_joints(network, robot, names)
    stiffness, damping = (_numbers(network, key, _json(network, key)) for key in ("kp", "kd"))
    order = [robot.joint_names.index(name) for name in names]
    trained = _trained(network)
    angles = trained.get("init_state", {}).get("default_joint_angles")
    default = robot.nominal[7:][order] if angles is None else [angles.get(name) for name in names]
    return PolicyForm(
        joint_names=tuple(names),
        default=_numbers(network, "default_joint_angles", default),
        scale=_holosoma_scale(network, trained.get("control", {}), robot.effort_limit[order] / stiffness),
        stiffness=stiffness,
        damping=damping,
        anchor=robot.anchor_body,
        observations=tuple(sorted(_present(network), key=lambda name: _HOLOSOMA.get(name, name))),
    )


def _trained(network: Network) -> Mapping[str, Any]:
    """What the file says of the robot holosoma trained with; nothing where it says nothing."""
    if "experiment_config" not in network.metadata:
        return {}
    config = _json(network, "experiment_config")
    robot: Mapping[str, Any] | None = config.get("robot") if isinstance(config, dict) else None
    if not isinstance(robot, dict) or not all(
        isinstance(robot.get(key, {}), dict) for key in ("init_state", "control")
    ):
        raise PolicyError(f"{network.path}: experiment_config in its metadata does not describe a robot")
    return robot


def _holosoma_scale(network: Network, control: Mapping[str, Any], reach: np.ndarray) -> np.ndarray:
    """What an action of one adds to the default angles, ``reach`` being effort limits over kp [rad].  # (29,)"""
    if "action_scale" in network.metadata:
        return _numbers(network, "action_scale", _json(network, "action_scale"))
    if "action_scale" not in control:
        raise PolicyError(
            f"{network.path}: its metadata has neither 'action_scale' nor an 'experiment_config' that says what an "
            "action is; write 'action_scale' [rad] into it (1 where its actions are radians)"
        )
    scale = _numbers(network, "action_scale of experiment_config", control["action_scale"])
    return scale * reach if control.get("action_scales_by_effort_limit_over_p_gain") else scale


def _present(network: Network) -> tuple[str, ...]:
    """The observations that a network of its width has."""
    return tuple(name for name in WIDTH if network.inputs == max(WIDTHS) or name not in ESTIMATED)


def _known(network: Network, names: list[str]) -> tuple[str, ...]:
    unknown = next((name for name in names if name not in WIDTH), None)
    if unknown is not None:
        raise PolicyError(f"{network.path}: observes {unknown!r}; known are {', '.join(WIDTH)}")
    total = sum(WIDTH[name] for name in names)
    if total != network.inputs:
        raise PolicyError(f"{network.path}: its observation_names are {total} numbers, it takes {network.inputs}")
    return tuple(names)


def _check_joints(network: Network, robot: Robot, names: list[str]) -> None:
    if sorted(names) != sorted(robot.joint_names) or len(names) != JOINTS:
        strange = next((name for name in names if name not in robot.joint_names), "another number of joints")
        raise PolicyError(f"{network.path}: is for another robot than {robot.name}: it has {strange}")


def _text(network: Network, key: str) -> str:
    if key not in network.metadata:
        raise PolicyError(f"{network.path}: its metadata has no {key!r}; export it with its metadata")
    return network.metadata[key]


def _texts(network: Network, key: str) -> list[str]:
    return [part.strip() for part in _text(network, key).split(",")]


def _json(network: Network, key: str) -> Any:
    try:
        return json.loads(_text(network, key))
    except ValueError:
        raise PolicyError(f"{network.path}: {key} in its metadata is not JSON") from None


def _numbers(network: Network, key: str, given: Any) -> np.ndarray:
    """One number a joint; a single one stands for all."""
    try:
        values = np.array(given, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        shown = ",".join(map(str, given)) if isinstance(given, list) else given
        raise PolicyError(f"{network.path}: {key} in its metadata is {shown!r}, not numbers") from None
    if len(values) not in (1, JOINTS) or not np.isfinite(values).all():
        raise PolicyError(f"{network.path}: {key} in its metadata has {len(values)} numbers; expected {JOINTS}")
    return np.broadcast_to(values, (JOINTS,)).copy()
