from __future__ import annotations

import numpy as np
import pytest
from people import SPEED, walker
from scipy.spatial.transform import Rotation

from gmr_traj import resources
from gmr_traj.exceptions import MapError, ResourceError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.retarget import protomotions
from gmr_traj.retarget.body_map import BodyMap, load_map
from gmr_traj.retarget.inverse_kinematics import InverseKinematics
from gmr_traj.retarget.landmarks import match
from gmr_traj.retarget.options import Options
from gmr_traj.robot import Robot


@pytest.fixture
def body_map(g1: Robot) -> BodyMap:
    return load_map("lafan1_to_unitree_g1", g1)


def test_the_stride_depends_on_the_heading(g1, body_map):
    """The method's fault: it is 0.75 of the person's along x and all of it along y."""
    walked = {}
    for name, heading in (("x", 0.0), ("y", 0.5 * np.pi)):
        human = walker(90, heading=heading)
        qpos = protomotions.solve(human, g1, body_map, Options()).qpos
        walked[name] = np.linalg.norm(qpos[-1, :2] - qpos[30, :2]) / (SPEED * 59 / 30.0)
    assert walked["x"] == pytest.approx(0.75, abs=0.02)
    assert walked["y"] == pytest.approx(1.0, abs=0.02)


def test_targets_are_scaled_in_the_world(g1, body_map):
    human = walker(10, heading=0.4)
    settings = protomotions.ProtoMotionsSettings.read(g1)
    targets = protomotions.world_scaled(human, match(human, settings.points), body_map, settings.scale)
    ankle = targets.names.index("left_ankle_roll_link")
    expected = human.positions[:, human.index("LeftFoot")] * [0.75, 1.0, 0.8]
    np.testing.assert_allclose(targets.positions[:, ankle], expected, atol=1e-12)
    head = targets.names.index("torso_link")
    np.testing.assert_array_equal(targets.points[head], [0.0, 0.0, 0.4])
    # Orientations come from the map, where it has the body: the foot's is that of the toe's joint.
    foot = next(target for target in body_map.targets if target.body == "left_ankle_roll_link")
    wanted = Rotation.from_euler("z", 0.4) * Rotation.from_quat(foot.rotation_offset, scalar_first=True)
    same = Rotation.from_quat(targets.quaternions[0, ankle], scalar_first=True) * wanted.inv()
    assert same.magnitude() == pytest.approx(0.0, abs=1e-9)
    shoulder = targets.names.index("left_shoulder_pitch_link")
    assert targets.orientation_weights[ankle] == 1.0 and targets.orientation_weights[shoulder] == 0.0


def test_both_corrections_of_the_height(g1, body_map):
    human = walker(40)
    person = human.positions[..., 2].min(axis=1)
    each = protomotions.solve(human, g1, body_map, Options()).qpos
    np.testing.assert_allclose(placements(g1, each)[0][..., 2].min(axis=1), person, atol=1e-9)
    clip = protomotions.solve(human, g1, body_map, Options(), height="clip").qpos
    assert placements(g1, clip)[0][..., 2].min() == pytest.approx(person.min())
    np.testing.assert_allclose(np.delete(clip, 2, axis=1), np.delete(each, 2, axis=1), atol=1e-12)


def test_a_step_is_minks(g1, body_map):
    mink = pytest.importorskip("mink", reason="mink is in the extra 'dev'")
    settings = protomotions.ProtoMotionsSettings.read(g1)
    human = walker(3, heading=0.3)
    targets = protomotions.world_scaled(human, match(human, settings.points), body_map, settings.scale)
    q = np.array(g1.nominal)
    q[:3], q[7:] = targets.positions[0, 0], q[7:] + 0.1
    q[7:] = np.clip(q[7:], g1.position_lower, g1.position_upper)
    configuration = mink.Configuration(g1.model)
    configuration.update(q)
    tasks: list[mink.Task] = []
    own = [k for k, name in enumerate(targets.names) if name != "torso_link"]  # mink's frames have no points
    for k in own:
        costs = settings.position_cost, settings.orientation_cost * targets.orientation_weights[k]
        task = mink.FrameTask(targets.names[k], "body", *costs, lm_damping=settings.lm_damping)
        turn = mink.SO3(targets.quaternions[0, k])
        task.set_target(mink.SE3.from_rotation_and_translation(turn, targets.positions[0, k]))
        tasks.append(task)
    posture = mink.PostureTask(g1.model, cost=settings.posture_cost)
    zero = np.zeros(7 + g1.dof)
    zero[3] = 1.0
    posture.set_target(zero)
    limits = [mink.ConfigurationLimit(g1.model, gain=settings.limit_gain)]
    dt = 1.0 / 60.0
    v = mink.solve_ik(configuration, [*tasks, posture], dt, "daqp", damping=settings.damping, limits=limits)
    expected = configuration.integrate(v, dt)

    turned = settings.orientation_cost * targets.orientation_weights[own]
    weights = np.stack([np.full(len(own), settings.position_cost), turned], axis=1)
    names = [targets.names[k] for k in own]
    ik = InverseKinematics(g1, names, np.zeros((len(own), 3)), [weights], damping=settings.damping, lm_damping=1.0)
    ik.aim(targets.positions[0, own], targets.quaternions[0, own])
    np.testing.assert_allclose(protomotions.step(ik, q, g1, settings, None), expected, atol=1e-6)


def test_joints_are_within_their_range_and_speed_where_asked(g1, body_map):
    human = walker(40)
    free = protomotions.solve(human, g1, body_map, Options()).qpos[:, 7:]
    assert (free >= g1.position_lower - 1e-9).all() and (free <= g1.position_upper + 1e-9).all()
    slow = protomotions.solve(human, g1, body_map, Options(velocity_limit=0.02)).qpos[:, 7:]
    speed = np.abs(np.diff(slow, axis=0)) * human.fps
    assert (speed <= 0.02 * g1.velocity_limit + 1e-6).all()
    assert (np.abs(np.diff(free, axis=0)) * human.fps > 0.02 * g1.velocity_limit).any()


def test_progress_is_told(g1, body_map):
    told: list[tuple[str, int, int]] = []
    protomotions.solve(walker(25), g1, body_map, Options(progress=lambda *what: told.append(what)))
    assert told[-1] == ("retargeting", 25, 25)


def test_what_it_cannot_do(g1, body_map):
    from dataclasses import replace

    with pytest.raises(MapError, match="no landmarks of the human rig 'unknown'"):
        protomotions.solve(replace(walker(5), rig="unknown"), g1, body_map, Options())
    with pytest.raises(MapError, match="made for lafan1, and the motion is of the rig cmu"):
        protomotions.solve(replace(walker(5), rig="cmu"), g1, body_map, Options())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("scale = [0.75, 1.0, 0.8]", "scale = [0.75, 0.0, 0.8]", "scale must be above 0"),
        ("solves_per_frame = 2", "solves_per_frame = 0", "solves_per_frame must be at least 1"),
        ("limit_gain = 0.95", "limit_gain = 1.5", "a step would cross the limit"),
        ('body = "left_knee_link"', 'body = "pelvis"', "gives body 'pelvis' two points"),
        ('robot = "unitree_g1"', 'robot = "unitree_h1"', "is for robot 'unitree_h1'"),
    ],
)
def test_a_wrong_settings_file_is_named(g1, tmp_path, monkeypatch, old, new, message):
    text = (resources.folder("configs") / "protomotions_unitree_g1.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "protomotions_unitree_g1.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    monkeypatch.setattr(resources, "folder", lambda kind: tmp_path)
    with pytest.raises(ResourceError, match=message) as caught:
        protomotions.ProtoMotionsSettings.read(g1)
    assert "protomotions_unitree_g1.toml" in str(caught.value)
