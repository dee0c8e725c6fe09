from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from people import walker
from scipy.spatial.transform import Rotation

from gmr_traj import resources
from gmr_traj.exceptions import ClipError, MapError, ResourceError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.batched_kinematics import BatchedKinematics
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.retarget import phc
from gmr_traj.retarget.body_map import BodyMap, load_map
from gmr_traj.retarget.ground import heights
from gmr_traj.retarget.landmarks import Landmarks, match, thinned
from gmr_traj.retarget.options import Options, Solved
from gmr_traj.retarget.retarget import retarget
from gmr_traj.retarget.skeleton_fit import fit_bones, with_bones
from gmr_traj.robot import Robot


@pytest.fixture(scope="module")
def body_map(g1: Robot) -> BodyMap:
    return load_map("lafan1_to_unitree_g1", g1)


@pytest.fixture(scope="module")
def solved(g1: Robot, body_map: BodyMap) -> Solved:
    return phc.solve(walker(30), g1, body_map, Options())


def landmarks_of(human: HumanMotion, robot: Robot) -> Landmarks:
    return match(human, phc.PhcSettings.read(robot, "adam").points)


def at_zero(landmarks: Landmarks, robot: Robot) -> np.ndarray:
    kinematics = BatchedKinematics(robot, [(p.body, p.point) for p in landmarks.points])
    return kinematics.place(np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, robot.dof))).points[0]


def test_bones_get_the_robots_lengths(g1):
    human = walker()
    landmarks = landmarks_of(human, g1)
    fitted = with_bones(human, fit_bones(human, landmarks, g1, penalty=1e-4))[:, landmarks.joints]
    robot = at_zero(landmarks, g1)
    for one, other in (("left_knee", "left_ankle"), ("right_elbow", "right_wrist"), ("left_ankle", "left_toe")):
        i, k = landmarks.index(one), landmarks.index(other)
        length = np.linalg.norm(fitted[:, i] - fitted[:, k], axis=1)
        np.testing.assert_allclose(length, np.linalg.norm(robot[i] - robot[k]), atol=0.003, err_msg=f"{one}-{other}")


def test_bones_keep_their_directions_and_the_root_its_path(g1):
    human = walker(heading=0.7)
    ratios = fit_bones(human, landmarks_of(human, g1), g1, penalty=0.01)
    fitted = with_bones(human, ratios)
    np.testing.assert_array_equal(fitted[:, 0], human.positions[:, 0])
    for j, parent in enumerate(human.parents):
        if parent >= 0:
            bone = human.positions[:, j] - human.positions[:, parent]
            np.testing.assert_allclose(fitted[:, j] - fitted[:, parent], ratios[j] * bone, atol=1e-12)


def test_a_large_penalty_leaves_one_scale(g1):
    human = walker()
    ratios = fit_bones(human, landmarks_of(human, g1), g1, penalty=100.0)
    np.testing.assert_allclose(ratios[1:], ratios[1], rtol=1e-3)
    assert 0.5 < ratios[1] < 0.9


def test_the_distances_gradient_by_finite_differences():
    rng = np.random.default_rng(0)
    points, targets = rng.normal(size=(2, 3, 4, 3))
    value, gradient = phc.mean_distance(points, targets)
    assert value == pytest.approx(np.mean(np.linalg.norm(points - targets, axis=2)))
    for index in np.ndindex(points.shape):
        step = np.zeros_like(points)
        step[index] = 1e-6
        slope = (phc.mean_distance(points + step, targets)[0] - phc.mean_distance(points - step, targets)[0]) / 2e-6
        assert gradient[index] == pytest.approx(slope, abs=1e-9)
    assert not phc.mean_distance(points, points)[1].any()


def test_targets_that_can_be_met_are_met(g1):
    human, settings = walker(40), phc.PhcSettings.read(g1, "adam")
    landmarks = landmarks_of(human, g1)
    kinematics = BatchedKinematics(g1, [(p.body, p.point) for p in landmarks.points])
    time = np.linspace(0.0, 2.0 * np.pi, 40)
    joints = np.tile(g1.nominal[7:], (40, 1))
    joints[:, g1.joint_names.index("left_knee_joint")] += 0.3 * np.sin(time)
    root = np.stack([0.5 * time, np.zeros(40), np.full(40, 0.75)], axis=1)
    turn = Rotation.from_euler("z", np.full((40, 1), 2.0)).as_matrix()
    targets = kinematics.place(root, turn, joints).points
    start = root + np.array([0.05, -0.03, 0.02])  # one offset for the clip has to be found
    qpos = phc.descend(start, targets, landmarks, g1, replace(settings, iterations=700, posture=0.0))
    rotation = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_matrix()
    value, _ = phc.mean_distance(kinematics.place(qpos[:, :3], rotation, qpos[:, 7:]).points, targets)
    assert value < 0.01
    np.testing.assert_allclose(qpos[:, :3] - start, (qpos[0, :3] - start[0])[None].repeat(40, axis=0), atol=1e-12)


def test_joints_are_within_their_range_and_the_frames_are_the_persons(g1, solved):
    human = walker(30)
    assert solved.qpos.shape == (30, 36)
    joints = solved.qpos[:, 7:]
    assert (joints >= g1.position_lower - 1e-12).all() and (joints <= g1.position_upper + 1e-12).all()
    # The root's path is the person's, but for one offset: not scaled to the robot.
    path = solved.qpos[:, :3] - human.positions[:, 0]
    np.testing.assert_allclose(path, path[:1].repeat(30, axis=0), atol=1e-12)


def test_both_corrections_of_the_height(g1, body_map, solved):
    human = walker(30)
    assert heights(g1, solved.qpos[:1]).lowest[0] == pytest.approx(0.0, abs=1e-9)
    mean = phc.solve(human, g1, body_map, Options(), height="mean-minimum")
    shift = (mean.qpos - solved.qpos)[:, :3]
    np.testing.assert_allclose(shift, shift[:1].repeat(30, axis=0), atol=1e-12)
    toes = [p for p in landmarks_of(human, g1).points if p.landmark.endswith("toe")]
    rotation = Rotation.from_quat(mean.qpos[:, 3:7], scalar_first=True).as_matrix()
    kinematics = BatchedKinematics(g1, [(p.body, p.point) for p in toes])
    lowest = kinematics.place(mean.qpos[:, :3], rotation, mean.qpos[:, 7:]).points[..., 2].min(axis=1)
    origins = placements(g1, mean.qpos)[0][..., 2].min(axis=1)
    assert np.minimum(lowest, origins).mean() == pytest.approx(0.0, abs=1e-9)


def test_the_heading_hardly_matters(g1, body_map, solved):
    ahead = solved.qpos
    turned = phc.solve(walker(30, heading=2.5), g1, body_map, Options()).qpos
    # Adam treats each component of a rotation vector for itself, so it is not the same descent.
    np.testing.assert_allclose(turned[:, 2], ahead[:, 2], atol=0.03)
    assert np.abs(turned[:, 7:] - ahead[:, 7:]).mean() < 0.06


def test_adadelta_moves_the_joints_of_long_clips_less(g1):
    """Its step is about 100 times a gradient that is a mean over frames; Adam's is not."""
    moved = {}
    for kind in ("adadelta", "adam"):
        settings = replace(phc.PhcSettings.read(g1, kind), iterations=40, posture=0.0)
        for frames in (30, 240):
            human = walker(frames, speed=0.0)
            landmarks = landmarks_of(human, g1)
            targets = with_bones(human, fit_bones(human, landmarks, g1, 0.01))[:, landmarks.joints]
            qpos = phc.descend(human.positions[:, 0], targets, landmarks, g1, settings)
            moved[kind, frames] = np.abs(qpos[:, 7:]).mean()
    assert moved["adadelta", 240] < 0.5 * moved["adadelta", 30]
    assert moved["adam", 240] == pytest.approx(moved["adam", 30], rel=0.1)


def test_how_far_it_got_is_said(g1, body_map, solved):
    landmarks = landmarks_of(walker(30), g1)
    first = [k for k, point in enumerate(landmarks.points) if not point.landmark.endswith("toe")]
    away, _ = phc.mean_distance(phc.points_of(g1, solved.qpos, landmarks)[:, first], solved.targets.positions)
    said = int(solved.notes[0].split(" mm away")[0].split()[-1])
    assert said == pytest.approx(1e3 * away, abs=8.0) and said > 0


def test_fast_input_is_thinned_out(g1, body_map):
    human = walker(100, fps=120.0)
    assert thinned(human, 30.0).frames == 25
    clip = retarget(human, g1, body_map, method="phc-adam")
    assert clip.motion.fps == 30.0 and clip.motion.frames == 25 and clip.references.frames == 25
    assert thinned(walker(100, fps=59.94), 30.0).fps == pytest.approx(59.94)


def test_what_it_cannot_do(g1, body_map, tmp_path, monkeypatch):
    stranger = replace(walker(5), rig="unknown")
    with pytest.raises(MapError, match="no landmarks of the human rig 'unknown'; it knows those of lafan1"):
        phc.solve(stranger, g1, body_map, Options())
    renamed = replace(walker(5), names=("Pelvis", *walker(5).names[1:]), contacts={})
    with pytest.raises(ClipError, match="no joint 'Hips'"):
        phc.solve(renamed, g1, body_map, Options())
    with pytest.raises(ResourceError, match="method phc has no points for robot other"):
        phc.PhcSettings.read(replace(g1, name="other"), "adam")
    assert "no effect" in phc.solve(walker(5), g1, body_map, Options(velocity_limit=1.0)).notes[1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('body = "pelvis"', 'body = "pelvs"', r"body is 'pelvs'; robot unitree_g1 has pelvis"),
        ('landmark = "left_hip"', 'landmark = "left_thigh"', "has no landmark 'left_hip'"),
        ('landmark = "left_knee"', 'landmark = "head"', "repeats landmark 'head'"),
        ("iterations = 500", "iterations = 0", "iterations must be at least 1"),
        ('joint_optimiser = "adam"', 'joint_optimizer = "adam"', "has no 'joint_optimiser'"),
        ("penalty = 0.01", "penalty = 0.01\npenalties = 1", "unknown field 'penalties'"),
    ],
)
def test_a_wrong_settings_file_is_named(g1, tmp_path, monkeypatch, old, new, message):
    text = (resources.folder("configs") / "phc_unitree_g1.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "phc_unitree_g1.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    monkeypatch.setattr(resources, "folder", lambda kind: tmp_path)
    with pytest.raises(ResourceError, match=message) as caught:
        phc.PhcSettings.read(g1, "adam")
    assert "phc_unitree_g1.toml" in str(caught.value)


def test_it_does_what_the_original_did(g1, data_dir):
    """Against clips that ASAP made with PHC (23 joints) from the same SMPL motions."""
    from gmr_traj.comparison import Entrant
    from gmr_traj.comparison.entrant import align
    from gmr_traj.formats import read_clip
    from gmr_traj.formats.human import read_human

    name = "video_walk_level1_filter_amass"
    source, original = data_dir / "smpl_npz" / f"{name}.npz", next((data_dir / "phc_pkl").glob(f"*{name}.pkl"), None)
    if not source.is_file() or original is None:
        pytest.skip(f"no {name} in {data_dir}")
    ours = retarget(read_human(source), g1, load_map("smplx_to_unitree_g1", g1), method="phc").motion
    theirs = read_clip(original, g1).motion
    assert (ours.frames, ours.fps) == (theirs.frames, theirs.fps)
    field = align([Entrant("ours", ours), Entrant("theirs", theirs)], g1)
    mine, other = (clip.shared.positions for clip in field.clips)
    # The root follows the person's own path, not a scaled one: the same path in both.
    paths = [p[:, 0, :2] - p[:, 0, :2].mean(axis=0) for p in (mine, other)]
    assert np.linalg.norm(paths[0] - paths[1], axis=1).mean() < 0.02 < 0.1 * np.ptp(paths[1], axis=0).max()
    keys = [field.robot.body_names.index(k.body) for k in field.robot.key_bodies if k.body in field.bodies]
    relative = (mine[:, keys] - mine[:, :1]) - (other[:, keys] - other[:, :1])
    assert np.linalg.norm(relative, axis=2).mean() < 0.035
