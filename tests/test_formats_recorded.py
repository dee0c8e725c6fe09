"""Recorded clips of seven projects: format, joints, and a robot that stands on the floor. Not part of the project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import read_clip, write_clip
from gmr_traj.formats.decide import reduced
from gmr_traj.formats.standing import StandingTest
from gmr_traj.robot import Robot

FOLDERS = {
    "gmr_pkl": ("gmr", 29, 10),
    "gmt_pkl": ("gmr", 23, 2),
    "gmr_reference": ("gmr-traj", 29, 4),
    "lafan1_unitree_csv": ("unitree-csv", 29, 3),
    "protomotions_csv": ("protomotions-csv", 29, 2),
    "holosoma_npz": ("holosoma", 29, 1),
    "phc_pkl": ("phc", 23, 4),
}


@pytest.mark.parametrize("folder", FOLDERS)
def test_recorded_clips(folder: str, g1: Robot, data_dir: Path, tmp_path: Path) -> None:
    name, joints, count = FOLDERS[folder]
    paths = sorted((data_dir / folder).iterdir())
    assert len(paths) == count
    for path in paths:
        clip = read_clip(path, g1)
        assert clip.format == name
        assert len(clip.motion.joint_names) == joints
        qpos = clip.motion.qpos
        standing = StandingTest(reduced(g1, clip.motion.joint_names), qpos[:, 7:], clip.motion.fps)
        assert abs(standing.lowest_sole(qpos[:, :3], qpos[:, 3:7])) < 0.2  # one clip floats by 14 cm
        assert standing.oddness(qpos[:, :3], qpos[:, 3:7]) < 5.0
        up = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_matrix()[:, 2, 2]
        assert np.median(up) > 0.8
        write_clip(clip, tmp_path / "out", robot=g1)
        again = read_clip(tmp_path / "out", g1)
        assert again.format == name
        assert np.abs(again.motion.qpos - qpos).max() < 1e-7
        assert again.motion.fps == clip.motion.fps


def test_human_motions_are_named_as_such(g1: Robot, data_dir: Path) -> None:
    for path in sorted([*(data_dir / "smpl_npz").iterdir(), *(data_dir / "lafan1_bvh").iterdir()]):
        with pytest.raises(ClipError, match="human motion"):
            read_clip(path, g1)


@pytest.mark.parametrize("folder", ["lafan1_unitree_csv", "protomotions_csv"])
def test_orders_are_told_in_short_cuts(folder: str, g1: Robot, data_dir: Path, tmp_path: Path) -> None:
    """Two seconds from anywhere are either read rightly or asked about, never read wrongly."""
    asked = total = 0
    for path in sorted((data_dir / folder).iterdir()):
        lines = path.read_text().splitlines()
        for start in np.linspace(0, len(lines) - 60, 12).astype(int):
            (tmp_path / "cut.csv").write_text("\n".join(lines[start : start + 60]))
            total += 1
            try:
                assert read_clip(tmp_path / "cut.csv", g1).format == FOLDERS[folder][0]
            except ClipError as error:
                assert "set --quaternion" in str(error)
                asked += 1
    assert asked <= 0.1 * total


def test_bodies_the_robot_lacks_keep_their_place(g1: Robot, data_dir: Path, tmp_path: Path) -> None:
    """GMR's toes and head, holosoma's hands and spheres: written anew, they are where the files had them."""
    path = min((data_dir / "gmr_pkl").iterdir())
    clip = read_clip(path, g1)
    write_clip(clip, tmp_path / "out", robot=g1)
    before, after = clip.extras["content"], read_clip(tmp_path / "out", g1).extras["content"]
    assert after["link_body_list"] == before["link_body_list"]
    assert np.abs(after["local_body_pos"] - before["local_body_pos"]).max() < 2e-6
    path = min((data_dir / "holosoma_npz").iterdir())
    clip = read_clip(path, g1)
    write_clip(clip, tmp_path / "out", robot=g1)
    before, after = clip.extras["content"], read_clip(tmp_path / "out", g1).extras["content"]
    assert list(after) == list(before)
    # Its description of the waist differs from ours by up to a centimetre.
    assert np.abs(after["body_pos_w"] - before["body_pos_w"]).max() < 0.011
    np.testing.assert_allclose(after["joint_vel"], before["joint_vel"], atol=1e-4)
