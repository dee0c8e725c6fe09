"""Retargeting recorded motion: the same as GMR's own code, faster, and whatever the heading and the start."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from retarget_setup import cut, largest_difference, minks_coupling

from gmr_traj.bench.gmr_loop import gmr_loop
from gmr_traj.formats.human import read_human
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.retarget import inverse_kinematics
from gmr_traj.retarget.body_map import default_map_name, load_map
from gmr_traj.retarget.retarget import retarget
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot

pytestmark = pytest.mark.slow

REFERENCES = ("dance1_subject1", "dance2_subject3_hand", "jumps1_subject5_big", "walk1_subject1_walk2")
CLIPS = (
    *REFERENCES,
    "dance1_subject2",
    "fightAndSports1_subject1_joy",
    "pushAndFall1_subject1_push",
    "run2_subject4_run2",
    "walk2_subject3_salut",
)
STARTS, LENGTH = 20, 12


def file(data_dir: Path, kind: str, name: str) -> Path:
    path = data_dir / kind / name
    if not path.is_file():
        pytest.skip(f"no recorded motion: {path} does not exist")
    return path


@pytest.mark.parametrize("name", REFERENCES)
def test_gmr_code_is_what_gmr_gives(g1: Robot, data_dir: Path, name: str, monkeypatch: pytest.MonkeyPatch):
    expected = np.load(file(data_dir, "gmr_reference", f"{name}.npz"))["qpos"]
    human = read_human(file(data_dir, "lafan1_bvh", f"{name}.bvh"))
    body_map = load_map("lafan1_to_unitree_g1", g1)
    found = retarget(human, g1, body_map, method="gmr-code").motion.qpos
    difference = np.abs(found[:, 7:] - expected[:, 7:])
    assert np.median(difference) < 1e-6
    assert difference.max() < 0.02
    apart = np.linalg.norm(placements(g1, found)[0] - placements(g1, expected)[0], axis=2)
    assert (apart.mean(), apart.max()) < (1e-5, 2e-3)
    monkeypatch.setattr(inverse_kinematics, "coupling", minks_coupling)
    found = retarget(human, g1, body_map, method="gmr-code").motion.qpos
    assert largest_difference(g1, expected, found) < 1e-5


def test_gmr_used_its_own_joint_ranges(g1: Robot, data_dir: Path):
    """With Unitree's ranges the hand clip comes out another way: GMR's must be the narrower ones."""
    name = "dance2_subject3_hand"
    expected = np.load(file(data_dir, "gmr_reference", f"{name}.npz"))["qpos"]
    human = read_human(file(data_dir, "lafan1_bvh", f"{name}.bvh"))
    stock = replace(load_map("lafan1_to_unitree_g1", g1), joint_ranges={})
    found = retarget(human, g1, stock, method="gmr-code").motion.qpos
    assert np.median(np.abs(found[:, 7:] - expected[:, 7:])) > 0.1


@pytest.mark.parametrize("name", CLIPS)
def test_neither_heading_nor_start_makes_a_difference(g1: Robot, data_dir: Path, name: str):
    human = read_human(file(data_dir, "lafan1_bvh", f"{name}.bvh"))
    body_map = load_map("lafan1_to_unitree_g1", g1)
    for first in np.linspace(0, human.frames - LENGTH, STARTS).astype(int):
        one, other = (retarget(cut(human, first, LENGTH, turn), g1, body_map).motion.qpos[5:] for turn in (0.0, np.pi))
        assert largest_difference(g1, one, other, np.pi) < 1e-3


def test_faster_than_gmrs_loop(g1: Robot, data_dir: Path):
    human = read_human(file(data_dir, "lafan1_bvh", "walk1_subject1_walk2.bvh"))
    body_map = load_map("lafan1_to_unitree_g1", g1)
    targets = scaled_targets(human, body_map)
    seconds = {}
    for name, run in {
        "as published": lambda: gmr_loop(g1, body_map, targets, published=True),
        "mink at its best": lambda: gmr_loop(g1, body_map, targets),
        "gmr-code": lambda: retarget(human, g1, body_map, method="gmr-code"),
        "gmr": lambda: retarget(human, g1, body_map),
    }.items():
        started = time.process_time()
        run()
        seconds[name] = time.process_time() - started
    print({name: f"{human.frames / value:.0f} frames/s" for name, value in seconds.items()})
    assert seconds["gmr-code"] < seconds["mink at its best"] / 1.5
    assert seconds["gmr"] < seconds["as published"]


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("smpl_npz", "video_walk_level1_filter_amass.npz"),
        ("smpl_npz", "video_kick_level2_filter_amass.npz"),
        ("cmu_bvh", "131_01.bvh"),
    ],
)
def test_other_rigs_stand_and_follow(g1: Robot, data_dir: Path, kind: str, name: str):
    human = read_human(file(data_dir, kind, name))
    result = retarget(human, g1, load_map(default_map_name(human.rig, g1.name), g1))
    positions, rotations = placements(g1, result.motion.qpos)
    for body in ("pelvis", "left_ankle_roll_link", "right_ankle_roll_link"):
        b, k = g1.body_names.index(body), result.references.names.index(body)
        at = positions[:, b] + rotations[:, b] @ result.references.points[k]
        assert np.linalg.norm(at - result.references.positions[:, k], axis=1).mean() < 0.02
    torso = g1.body_names.index("torso_link")
    assert np.median(rotations[:, torso, 2, 2]) > 0.9  # upright
    assert np.median(positions[:, 0, 2]) > 0.6  # on straight legs for most of the time
