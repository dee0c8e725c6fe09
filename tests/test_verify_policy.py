"""Policies in ONNX files: their observations against their definition, and files that are wrong."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from verify_setup import squatting, standing

from gmr_traj.cli.main import main
from gmr_traj.exceptions import PolicyError
from gmr_traj.formats import read_clip
from gmr_traj.kinematics.mujoco_kinematics import placements, to_mujoco
from gmr_traj.motion import RobotMotion
from gmr_traj.verify import twist2_policy
from gmr_traj.verify.conditions import load_conditions
from gmr_traj.verify.policy import Network, load_policy, roll_pitch_yaw
from gmr_traj.verify.reference import reference
from gmr_traj.verify.rollout import roll_out

pytest.importorskip("onnxruntime", reason="onnxruntime is not installed; it is in the extra 'policy'")
onnx = pytest.importorskip("onnx", reason="onnx is not installed; it is in the extra 'test'")


def network(path: Path, inputs: int, outputs: int = 29, metadata: dict | None = None, step: bool = False) -> Path:
    """A linear network: every action is a hundredth of the first observations, and 0.1."""
    from onnx import TensorProto, helper, numpy_helper

    weight = np.zeros((inputs, outputs), dtype=np.float32)
    weight[np.arange(min(inputs, outputs)), np.arange(min(inputs, outputs))] = 0.01
    bias = np.full(outputs, 0.1, dtype=np.float32)
    given = [helper.make_tensor_value_info("obs", TensorProto.FLOAT, [1, inputs])]
    if step:
        given.append(helper.make_tensor_value_info("time_step", TensorProto.FLOAT, [1, 1]))
    graph = helper.make_graph(
        [helper.make_node("Gemm", ["obs", "W", "b"], ["actions"])],
        "policy",
        given,
        [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [1, outputs])],
        [numpy_helper.from_array(weight, "W"), numpy_helper.from_array(bias, "b")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    for key, value in (metadata or {}).items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    path.write_bytes(model.SerializeToString())
    return path


def beyondmimic_metadata(robot, **changes) -> dict[str, str]:
    """Metadata of a policy whose joints are in the reverse order."""
    order = np.arange(29)[::-1]
    out = {
        "joint_names": ",".join(robot.joint_names[k] for k in order),
        "default_joint_pos": ",".join(f"{x:.6f}" for x in robot.nominal[7:][order]),
        "joint_stiffness": ",".join(f"{x:.6f}" for x in robot.stiffness[order]),
        "joint_damping": ",".join(f"{x:.6f}" for x in robot.damping[order]),
        "action_scale": "0.5",
        "anchor_body_name": "torso_link",
    }
    out.update(changes)
    return {key: value for key, value in out.items() if value is not None}


def turned_walk(robot) -> RobotMotion:
    """A squat that moves and turns at a steady rate: every observation is known."""
    qpos = squatting(robot, seconds=0.5).qpos.copy()
    time = np.arange(len(qpos)) / 50.0
    qpos[:, 0] += 0.3 * time
    turn = Rotation.from_euler("z", (0.7 + 0.4 * time)[:, None]) * Rotation.from_euler("y", 0.1)
    qpos[:, 3:7] = turn.as_quat(scalar_first=True)
    return RobotMotion(qpos, 50.0, robot.joint_names, robot.name)


def test_angles_of_a_quaternion():
    turns = Rotation.random(20, random_state=3)
    for turn in turns:
        yaw, pitch, roll = turn.as_euler("ZYX")
        np.testing.assert_allclose(roll_pitch_yaw(turn.as_quat(scalar_first=True)), (roll, pitch, yaw), atol=1e-9)


def test_what_twist2_sees(g1, tmp_path):
    policy = load_policy(network(tmp_path / "net.onnx", 1432), g1)
    wanted = reference(turned_walk(g1), g1)
    q, v = wanted.at(4)
    qvel = to_mujoco(q, v)
    qvel[6:] += 1.0
    policy.start(wanted, q, qvel)
    frame = policy._frame(4, q, qvel)
    assert frame.shape == (127,)
    R = Rotation.from_quat(q[3:7], scalar_first=True)
    np.testing.assert_allclose(frame[:2], R.inv().apply(v[:3])[:2], atol=1e-12)
    np.testing.assert_allclose(frame[2:5], [q[2], 0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(frame[5], R.inv().apply([0, 0, 0.4])[2], atol=1e-6)
    np.testing.assert_allclose(frame[6:35], q[7:])
    np.testing.assert_allclose(frame[35:38], 0.25 * qvel[3:6])
    np.testing.assert_allclose(frame[38:40], [0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(frame[40:69], q[7:] - twist2_policy.DEFAULT)
    ankles = [k for k, name in enumerate(g1.joint_names) if "ankle" in name]
    assert not frame[69:98][ankles].any() and np.count_nonzero(frame[69:98]) == 25
    assert not frame[98:].any(), "no action yet"


def test_twist2_remembers_ten_frames_without_the_present_one(g1, tmp_path):
    policy = load_policy(network(tmp_path / "net.onnx", 1432), g1)
    seen = []
    inner = policy._network
    policy._network = lambda observations, step=0: seen.append(observations) or inner(observations, step)
    wanted = reference(turned_walk(g1), g1)
    states = [(wanted.at(k)[0], np.full(35, 0.01 * k)) for k in range(13)]
    policy.start(wanted, *states[0])
    targets = [policy.target(k, *state) for k, state in enumerate(states)]
    last = seen[-1]
    np.testing.assert_array_equal(last[-35:], last[:35])
    for age in range(10):  # oldest first
        np.testing.assert_array_equal(last[127 * (age + 1) : 127 * (age + 2)], seen[2 + age][:127])
    # The network returns 0.1 and a hundredth of the first observations; the next frame carries that action.
    expected = 0.1 + 0.01 * seen[0][:29]
    np.testing.assert_allclose(seen[1][98:127], expected, atol=1e-6)
    np.testing.assert_allclose(targets[0], 0.5 * expected + twist2_policy.DEFAULT, atol=1e-6)


def test_steering_turns_the_command_toward_the_reference(g1, tmp_path):
    path = network(tmp_path / "net.onnx", 1432)
    plain, steered = load_policy(path, g1), load_policy(path, g1, steer=0.5)
    wanted = reference(standing(g1), g1)
    behind = wanted.q[0].copy()
    behind[:2] -= 0.2, -0.1
    for policy in (plain, steered):
        policy.start(wanted, behind, np.zeros(35))
    np.testing.assert_allclose(plain._mimic(0, behind)[:2], 0.0, atol=1e-12)
    np.testing.assert_allclose(steered._mimic(0, behind)[:2], [0.1, -0.05], atol=1e-12)
    turned = behind.copy()
    turned[3:7] = Rotation.from_euler("z", 0.4).as_quat(scalar_first=True)
    assert steered._mimic(0, turned)[5] == pytest.approx(-0.2)


@pytest.mark.parametrize("width", [154, 160])
def test_what_beyondmimic_sees(g1, tmp_path, width):
    path = network(tmp_path / "net.onnx", width, metadata=beyondmimic_metadata(g1), step=True)
    policy = load_policy(path, g1)
    wanted = reference(turned_walk(g1), g1)
    q, v = wanted.at(6)
    own = wanted.q[0].copy()
    own[7:] += 0.05
    qvel = np.linspace(-1.0, 1.0, 35)
    policy.start(wanted, own, qvel)
    seen = policy.observe(6, own, qvel)
    assert seen.shape == (width,)
    back = np.arange(29)[::-1]
    np.testing.assert_allclose(seen[:58], np.concatenate([q[7:][back], v[6:][back]]))
    positions, rotations = placements(g1, np.stack([q, own]))
    torso = g1.body_names.index("torso_link")
    R = rotations[1, torso]
    rest = seen[58:]
    if width == 160:
        np.testing.assert_allclose(rest[:3], R.T @ (positions[0, torso] - positions[1, torso]), atol=1e-12)
        rest = rest[3:]
    axes = R.T @ rotations[0, torso]
    np.testing.assert_allclose(rest[:6], [axes[0, 0], axes[0, 1], axes[1, 0], axes[1, 1], axes[2, 0], axes[2, 1]])
    rest = rest[6:]
    if width == 160:
        base = Rotation.from_quat(own[3:7], scalar_first=True)
        np.testing.assert_allclose(rest[:3], base.inv().apply(qvel[:3]), atol=1e-12)
        rest = rest[3:]
    np.testing.assert_allclose(rest[:3], qvel[3:6])
    np.testing.assert_allclose(rest[3:32], (own[7:] - g1.nominal[7:])[back], atol=1e-6)
    np.testing.assert_allclose(rest[32:61], qvel[6:][back])
    target = policy.target(6, own, qvel)
    expected = g1.nominal[7:][back] + 0.5 * (0.1 + 0.01 * seen[:29])
    np.testing.assert_allclose(target[back], expected, atol=1e-6)
    np.testing.assert_allclose(policy.motors(g1).stiffness, g1.stiffness, atol=1e-6)


@pytest.mark.parametrize(
    ("inputs", "outputs", "changes", "message"),
    [
        (100, 29, {}, r"takes 100 observations; expected 1432 \(TWIST2's tracker\) or 154 or 160"),
        (1432, 23, {}, "makes 23 actions; expected 29"),
        (160, 23, {}, "makes 23 actions; expected 29"),
        (160, 29, {"joint_names": None}, "its metadata has no 'joint_names'"),
        (160, 29, {"joint_names": "a,b"}, "is for another robot than unitree_g1: it has a"),
        (160, 29, {"action_scale": "x"}, "action_scale in its metadata is 'x', not numbers"),
        (160, 29, {"action_scale": "1,2"}, "has 2 numbers; expected 29"),
        (160, 29, {"joint_damping": "-1.0"}, "gains must be above zero"),
        (160, 29, {"anchor_body_name": "head"}, "anchor_body_name is 'head', which is no body"),
    ],
)
def test_policies_of_the_wrong_form(g1, tmp_path, inputs, outputs, changes, message):
    path = network(tmp_path / "net.onnx", inputs, outputs, beyondmimic_metadata(g1, **changes))
    with pytest.raises(PolicyError, match=message):
        load_policy(path, g1)


def test_the_command_says_in_one_line_what_is_wrong(g1, tmp_path, capsys, monkeypatch):
    clip = tmp_path / "still.npz"
    motion = standing(g1)
    np.savez(clip, qpos=motion.qpos, fps=motion.fps, joint_names=motion.joint_names, robot=motion.robot)
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a network")
    good = network(tmp_path / "good.onnx", 1432)

    def error(*arguments: str) -> str:
        assert main(["verify", str(clip), *arguments]) == 2
        captured = capsys.readouterr()
        assert captured.err.count("\n") == 1 and not captured.out
        return captured.err

    policy = ("--controller", "policy", "--policy")
    assert "there is no such policy file" in error(*policy, str(tmp_path / "none.onnx"))
    assert "is not an ONNX network that can be run" in error(*policy, str(broken))
    assert "belong together" in error("--controller", "policy")
    assert "belong together" in error("--policy", str(good))
    assert "--steer is -1" in error(*policy, str(good), "--steer", "-1")
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert "pip install 'gmr-traj[policy]'" in error(*policy, str(good))


def test_a_policy_that_only_stands(g1, tmp_path):
    """BeyondMimic's form end to end: zero actions are the default posture, which stands for half a second."""
    path = network(tmp_path / "net.onnx", 160, metadata=beyondmimic_metadata(g1, action_scale="0.0"), step=True)
    assert Network(path).metadata["anchor_body_name"] == "torso_link"
    found = roll_out(reference(standing(g1, 26), g1), load_policy(path, g1), load_conditions("sim"))
    assert found.controller == "policy beyondmimic" and found.tracking.success


def test_twist2_walks(data_dir, g1):
    """The real tracker on a real walk, past its jump in the first frames; root-relative errors, for it drifts."""
    file = data_dir / "policies" / "twist2_1017_20k.onnx"
    if not file.is_file():
        pytest.skip(f"{file} does not exist")
    walk = read_clip(data_dir / "gmr_pkl" / "0807_yanjie_walk_002.pkl", g1).motion
    wanted = reference(walk.with_qpos(walk.qpos[5:155]), g1)
    plain = roll_out(wanted, load_policy(file, g1), load_conditions("sim")).tracking
    steered = roll_out(wanted, load_policy(file, g1, steer=1.0), load_conditions("sim")).tracking
    assert plain.success and plain.mpbpe < 60.0
    assert steered.success and steered.g_mpbpe < plain.g_mpbpe
