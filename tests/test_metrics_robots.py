"""The metrics on real robots and recorded motion."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import random_configurations

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.formats import read_clip
from gmr_traj.metrics import artefacts, certify, measure
from gmr_traj.metrics.observation import observe
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot


def clip_of(robot: Robot, qpos: np.ndarray) -> RobotMotion:
    return RobotMotion(qpos, 30.0, robot.joint_names, robot.name)


def airborne(motion: RobotMotion) -> ContactSchedule:
    return ContactSchedule(motion.frames, motion.fps, ())


def test_self_collision_and_floor_agree_with_mujoco_on_the_model_itself(g1):
    motion = clip_of(g1, random_configurations(g1, 60, seed=1))
    found = observe(motion, g1)
    dense = np.zeros((motion.frames, len(g1.collision_pairs)))
    dense[found.overlaps.frame, found.overlaps.pair] = found.overlaps.depth
    geoms = [mujoco.mj_name2id(g1.model, mujoco.mjtObj.mjOBJ_GEOM, c.name) for c in g1.capsules]
    assert min(geoms) >= 0
    data, expected = mujoco.MjData(g1.model), np.zeros_like(dense)
    for t, q in enumerate(motion.qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(g1.model, data)
        for p, (i, j) in enumerate(g1.collision_pairs):
            gap = mujoco.mj_geomDistance(g1.model, data, geoms[i], geoms[j], 0.1, np.zeros(6))
            expected[t, p] = max(0.0, -gap)
    assert (expected > 0.01).sum() > 50
    np.testing.assert_allclose(dense, expected, atol=1e-6)


@pytest.mark.parametrize("name", ["g1", "talos"])
def test_standing_is_clean_for_every_robot(name, request):
    robot: Robot = request.getfixturevalue(name)
    motion = clip_of(robot, np.tile(robot.nominal, (40, 1)))
    stances = (Stance(s.name, k, part, 0, 40) for s in robot.soles for k, part in enumerate(s.parts))
    schedule = ContactSchedule(40, 30.0, tuple(sorted(stances)))
    assert artefacts(motion, robot, schedule) == ()
    certificate = certify(motion, motion, robot, schedule, levelling=0.0)
    assert certificate.held, certificate.broken
    assert {b.body for b in certificate.change.bodies} == {k.body for k in robot.key_bodies}


def test_the_dance_has_its_known_waist_jumps(g1, data_dir: Path):
    path = data_dir / "gmr_reference" / "dance1_subject1.npz"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    motion = read_clip(path, g1).motion
    waist = [a for a in artefacts(motion, g1, airborne(motion)) if a.kind == "jump" and a.where.startswith("waist")]
    for second in (61.80, 63.87, 91.10, 91.83):
        assert any(a.begin - 0.02 <= second <= a.end for a in waist), second
    assert len(waist) < 10


def test_careful_retargets_of_a_walk_have_next_to_no_jumps(g1, data_dir: Path):
    path = data_dir / "lafan1_unitree_csv" / "walk1_subject1.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    motion = read_clip(path, g1).motion
    kinds = [a.kind for a in artefacts(motion, g1, airborne(motion))]
    assert sum(kind in ("jump", "transient", "acceleration_spike", "velocity") for kind in kinds) <= 3


def test_first_frames_of_gmr_walks_are_recognised(g1, data_dir: Path):
    found = {}
    for path in sorted((data_dir / "gmr_pkl").glob("*.pkl")):
        motion = read_clip(path, g1).motion
        first = np.abs(np.diff(motion.qpos[:10, 7:], axis=0)).max(axis=1) * motion.fps
        kinds = {a.kind for a in artefacts(motion, g1, airborne(motion))}
        found[path.name] = ("transient" in kinds, bool(first[:3].max() > 5.0))
    if not found:
        pytest.skip(f"{data_dir / 'gmr_pkl'} has no clips")
    assert {name: transient for name, (transient, _) in found.items()} == {n: fast for n, (_, fast) in found.items()}


def test_two_minutes_are_measured_in_seconds(g1):
    frames = 3945
    wave = 0.3 * np.sin(np.arange(frames)[:, None] / 15.0 + np.arange(g1.dof))
    qpos = np.tile(g1.nominal, (frames, 1))
    qpos[:, 7:] = np.clip(qpos[:, 7:] + wave, g1.position_lower, g1.position_upper)
    motion = clip_of(g1, qpos)
    start = time.process_time()
    measure(motion, g1, airborne(motion))
    assert time.process_time() - start < 3.0  # 0.4 s on an idle machine


def test_the_metrics_share_no_code_with_the_problem():
    script = (
        "import sys, gmr_traj.metrics\n"
        "ours = ('casadi', 'gmr_traj.terms', 'gmr_traj.collision', 'gmr_traj.problem', 'gmr_traj.transcription')\n"
        "print([m for m in sys.modules if m.startswith(ours)])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
