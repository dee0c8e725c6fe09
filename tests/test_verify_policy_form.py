"""Metadata of policies of BeyondMimic's kind: who wrote them in which order, and networks that were trained."""

from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_verify_policy import beyondmimic_metadata, network, turned_walk

from gmr_traj.exceptions import PolicyError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.verify.conditions import load_conditions
from gmr_traj.verify.policy import Network, load_policy
from gmr_traj.verify.policy_form import WIDTH, WIDTHS, read_form
from gmr_traj.verify.reference import reference
from gmr_traj.verify.rollout import roll_out

ANGLES = 0.01 * np.arange(29)


def holosoma_metadata(robot, **changes) -> dict[str, str]:
    """Metadata of a policy whose joints are in the reverse order."""
    order = np.arange(29)[::-1]
    names = [robot.joint_names[k] for k in order]
    control = {"action_scale": 0.25, "action_scales_by_effort_limit_over_p_gain": True}
    config = {
        "robot": {"init_state": {"default_joint_angles": dict(zip(names, ANGLES, strict=True))}, "control": control}
    }
    out = {
        "dof_names": names,
        "kp": robot.stiffness[order].tolist(),
        "kd": robot.damping[order].tolist(),
        "experiment_config": config,
    }
    out.update(changes)
    return {key: json.dumps(value) for key, value in out.items() if value is not None}


def states(robot):
    """A reference, and a state beside it."""
    wanted = reference(turned_walk(robot), robot)
    own = wanted.q[0].copy()
    own[7:] += 0.05
    return wanted, own, np.linspace(-1.0, 1.0, 35)


@pytest.mark.parametrize("width", WIDTHS)
def test_holosoma_sees_the_same_in_another_order(g1, tmp_path, width):
    """Alphabetical, by its own names: actions, base velocities, dof positions and velocities, motion."""
    theirs = load_policy(network(tmp_path / "a.onnx", width, metadata=holosoma_metadata(g1)), g1)
    default = ",".join(map(str, ANGLES))
    usual = beyondmimic_metadata(g1, default_joint_pos=default)
    ours = load_policy(network(tmp_path / "b.onnx", width, metadata=usual), g1)
    wanted, own, qvel = states(g1)
    seen = []
    for policy in (theirs, ours):
        policy.start(wanted, own, qvel)
        policy._action = np.arange(29.0)
        seen.append(policy.observe(6, own, qvel))
    moves = seen[1][58:67] if width == 160 else seen[1][58:64]
    speeds = seen[1][67:73] if width == 160 else seen[1][64:67]
    linear, angular = speeds[:-3], speeds[-3:]
    joints, actions = seen[1][-87:-29], seen[1][-29:]
    place, axes = moves[:-6], moves[-6:]
    expected = np.concatenate([actions, angular, linear, joints, seen[1][:58], axes, place])
    np.testing.assert_array_equal(seen[0], expected)


def test_an_action_of_holosoma_s(g1, tmp_path):
    def scale(**changes):
        path = network(tmp_path / "net.onnx", 154, metadata=holosoma_metadata(g1, **changes))
        return read_form(Network(path), g1).scale

    reach = (g1.effort_limit / g1.stiffness)[::-1]
    np.testing.assert_allclose(scale(), 0.25 * reach)
    np.testing.assert_allclose(scale(action_scale=1.0), np.ones(29))
    np.testing.assert_allclose(scale(action_scale=ANGLES.tolist(), experiment_config=None), ANGLES)
    np.testing.assert_allclose(scale(experiment_config={"robot": {"control": {"action_scale": 0.5}}}), np.full(29, 0.5))


def test_the_order_is_that_of_observation_names(g1, tmp_path):
    names = [*list(WIDTH)[::-1]]
    given = beyondmimic_metadata(g1, observation_names=",".join(names))
    turned = load_policy(network(tmp_path / "a.onnx", 160, metadata=given), g1)
    usual = load_policy(network(tmp_path / "b.onnx", 160, metadata=beyondmimic_metadata(g1)), g1)
    wanted, own, qvel = states(g1)
    for policy in (turned, usual):
        policy.start(wanted, own, qvel)
    ends = np.cumsum(list(WIDTH.values()))
    parts = np.split(usual.observe(6, own, qvel), ends[:-1])
    np.testing.assert_array_equal(turned.observe(6, own, qvel), np.concatenate(parts[::-1]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"experiment_config": None}, "neither 'action_scale' nor an 'experiment_config' that says what an action is"),
        ({"experiment_config": [1]}, "experiment_config in its metadata does not describe a robot"),
        ({"experiment_config": {"robot": {"control": 3}}}, "does not describe a robot"),
        ({"dof_names": "hip"}, "dof_names in its metadata is 'hip', not a list of names"),
        ({"kp": None}, "its metadata has no 'kp'"),
        ({"kp": [1.0, 2.0]}, "kp in its metadata has 2 numbers; expected 29"),
        ({"kd": {"hip": 1}}, "kd in its metadata is .*, not numbers"),
        ({"kd": 0.0}, "damping has 0; gains must be above zero"),
    ],
)
def test_metadata_of_holosoma_that_are_wrong(g1, tmp_path, changes, message):
    path = network(tmp_path / "net.onnx", 154, metadata=holosoma_metadata(g1, **changes))
    with pytest.raises(PolicyError, match=message):
        load_policy(path, g1)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("command,height_scan", "observes 'height_scan'; known are command, motion_anchor_pos_b"),
        ("command,joint_pos", "its observation_names are 87 numbers, it takes 160"),
    ],
)
def test_observations_that_are_not_known(g1, tmp_path, names, message):
    path = network(tmp_path / "net.onnx", 160, metadata=beyondmimic_metadata(g1, observation_names=names))
    with pytest.raises(PolicyError, match=message):
        load_policy(path, g1)


def test_metadata_that_are_not_json(g1, tmp_path):
    path = network(tmp_path / "net.onnx", 154, metadata=holosoma_metadata(g1) | {"kp": "[1"})
    with pytest.raises(PolicyError, match="kp in its metadata is not JSON"):
        load_policy(path, g1)


def trained(name: str) -> Path:
    """A network of the package holosoma-inference; skips where that is not installed."""
    try:
        files = metadata.files("holosoma-inference") or []
    except metadata.PackageNotFoundError:
        pytest.skip("no trained network of this form: pip install --no-deps holosoma-inference")
    found = [file for file in files if file.name == name]
    if not found:
        pytest.skip(f"this version of holosoma-inference has no {name}")
    return Path(str(found[0].locate()))


def motion_within(path: Path, robot, ticks: int) -> RobotMotion:
    """The motion a network was trained on, which is among its outputs: joints, and the torso in the world."""
    import onnxruntime

    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    outputs = ["joint_pos", "ref_pos_xyz", "ref_quat_xyzw"]
    still = np.zeros((1, 154), dtype=np.float32)
    rows = [session.run(outputs, {"obs": still, "time_step": np.array([[k]], dtype=np.float32)}) for k in range(ticks)]
    joints, place, turn = (np.concatenate([row[k] for row in rows]) for k in range(3))
    qpos = np.zeros((ticks, 36))
    qpos[:, 3], qpos[:, 7:] = 1.0, joints
    positions, rotations = placements(robot, qpos)
    torso = robot.body_names.index("torso_link")
    base = Rotation.from_quat(turn) * Rotation.from_matrix(rotations[:, torso]).inv()
    qpos[:, :3] = place - base.apply(positions[:, torso])
    qpos[:, 3:7] = base.as_quat(scalar_first=True)
    return RobotMotion(qpos, 50.0, robot.joint_names, robot.name)


def test_a_trained_policy_dances(g1):
    """A trained network of this form, its metadata as they are, follows the dance it was trained on."""
    path = trained("ppo_g1_29dof_dancing.onnx")
    dance = motion_within(path, g1, 500)
    found = roll_out(reference(dance, g1), load_policy(path, g1), load_conditions("sim")).tracking
    assert found.success and found.success_full and found.mpbpe < 40.0
