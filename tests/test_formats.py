"""Every format: a file as others write it is recognised, read right, written back, and converted to every other."""

from __future__ import annotations

from pathlib import Path

import joblib
import numpy as np
import pytest
from clip_files import FILES, isaac_bodies, squats
from scipy.spatial.transform import Rotation

from gmr_traj.formats import FORMATS, read_clip, write_clip
from gmr_traj.formats.clip import Clip
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import reduce_robot

RATES = {"gmr": 29.875, "gmr-traj": 50.0, "mjlab": 50.0, "beyondmimic": 50.0, "holosoma": 50.0, "bones-csv": 120.0}


@pytest.fixture(scope="module")
def g1_23(g1: Robot) -> Robot:
    return reduce_robot(g1, tuple(name for name in g1.joint_names if "wrist" not in name))


@pytest.fixture(params=FILES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def make(name: str, robot: Robot, folder: Path, **kwargs: float) -> tuple[Path, np.ndarray]:
    write, ending, _ = FILES[name]
    path = folder / f"clip{ending}"
    qpos = squats(robot, **kwargs)  # type: ignore[arg-type]
    write(robot, qpos, path)
    return path, qpos


def same_configurations(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference, a quaternion and its negative being the same orientation."""
    turns = a[:, 3:7] * np.sign(np.sum(a[:, 3:7] * b[:, 3:7], axis=1))[:, None]
    return float(
        max(np.abs(np.hstack([a[:, :3] - b[:, :3], a[:, 7:] - b[:, 7:]])).max(), np.abs(turns - b[:, 3:7]).max())
    )


def test_every_format_has_a_sample() -> None:
    assert set(FILES) == set(FORMATS)


def test_recognised_and_read(name: str, g1: Robot, tmp_path: Path) -> None:
    path, qpos = make(name, g1, tmp_path)
    clip = read_clip(path, g1)
    assert clip.format == name
    assert clip.motion.joint_names == g1.joint_names
    assert clip.motion.robot == "unitree_g1"
    assert clip.motion.fps == RATES.get(name, 30.0)
    assert same_configurations(clip.motion.qpos, qpos) < FILES[name][2]


def test_read_without_wrists(name: str, g1: Robot, g1_23: Robot, tmp_path: Path) -> None:
    path, qpos = make(name, g1_23, tmp_path)
    clip = read_clip(path, g1)
    assert clip.format == name
    assert clip.motion.joint_names == g1_23.joint_names
    assert same_configurations(clip.motion.qpos, qpos) < FILES[name][2]
    write_clip(clip, tmp_path / "again", robot=g1)
    assert (
        same_configurations(read_clip(tmp_path / "again", g1, fps=clip.motion.fps).motion.qpos, qpos) < FILES[name][2]
    )


def test_the_ending_does_not_matter(name: str, g1: Robot, tmp_path: Path) -> None:
    path, _ = make(name, g1, tmp_path)
    path.rename(tmp_path / "clip.dat")
    assert read_clip(tmp_path / "clip.dat", g1).format == name


def test_round_trip(name: str, g1: Robot, tmp_path: Path) -> None:
    path, _ = make(name, g1, tmp_path)
    clip = read_clip(path, g1)
    assert write_clip(clip, tmp_path / "out") == ()
    again = read_clip(tmp_path / "out", g1)
    assert again.format == name
    assert again.motion.fps == clip.motion.fps
    exact = 1e-15 if name in ("gmr", "gmr-traj", "unitree-csv", "protomotions-csv", "holosoma", "bones-csv") else 6e-8
    assert np.abs(again.motion.qpos - clip.motion.qpos).max() <= exact


def test_same_clip_same_bytes(name: str, g1: Robot, tmp_path: Path) -> None:
    path, _ = make(name, g1, tmp_path)
    for out in ("a", "b"):
        write_clip(read_clip(path, g1), tmp_path / out, robot=g1)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("target", FILES)
def test_conversion(name: str, target: str, g1: Robot, tmp_path: Path) -> None:
    """There and back again, and what arrives is a file of the target format."""
    path, _ = make(name, g1, tmp_path)
    clip = read_clip(path, g1)
    write_clip(clip, tmp_path / "there", format=target, robot=g1)
    there = read_clip(tmp_path / "there", g1, fps=clip.motion.fps)
    assert there.format == target
    write_clip(there, tmp_path / "back", format=name, robot=g1)
    back = read_clip(tmp_path / "back", g1, fps=clip.motion.fps)
    assert back.format == name
    single = {"mjlab", "beyondmimic", "phc"}
    assert same_configurations(back.motion.qpos, clip.motion.qpos) < (3e-7 if {name, target} & single else 1e-9)


def test_a_changed_motion_is_written(name: str, g1: Robot, tmp_path: Path) -> None:
    """Everything that follows from the motion follows the new one: a file made from it directly has the same arrays."""
    path, _ = make(name, g1, tmp_path)
    clip = read_clip(path, g1)
    changed = squats(g1, heading=0.5)
    write_clip(clip.with_motion(clip.motion.with_qpos(changed)), tmp_path / "out", robot=g1)
    expected, _ = make(name, g1, tmp_path / "..", heading=0.5)
    got, want = read_clip(tmp_path / "out", g1), read_clip(expected, g1)
    assert same_configurations(got.motion.qpos, want.motion.qpos) < FILES[name][2]
    for key, value in _arrays(want).items():
        if "vel" not in key:  # the samples' velocities are cruder
            ours = _arrays(got)[key]
            if "quat" in key:
                ours = ours * np.sign(np.sum(ours * value, axis=-1, keepdims=True))
            np.testing.assert_allclose(ours, value, atol=2e-6, err_msg=key)


def _arrays(clip: Clip) -> dict[str, np.ndarray]:
    content = clip.extras.get("content", {})
    return {key: value for key, value in content.items() if isinstance(value, np.ndarray) and value.dtype.kind == "f"}


def test_body_velocities_of_trackers(g1: Robot, tmp_path: Path) -> None:
    """Velocities match differences of the placements; BeyondMimic's are of the centres of mass."""
    qpos = squats(g1, frames=200)
    qpos[:, 3:7] = Rotation.from_euler("xyz", np.linspace([0, 0, 0.3], [0.2, -0.3, 1.5], 200)).as_quat(
        scalar_first=True
    )
    FILES["gmr-traj"][0](g1, qpos, tmp_path / "in.npz")
    clip = read_clip(tmp_path / "in.npz", g1)
    for target in ("mjlab", "beyondmimic"):
        write_clip(clip, tmp_path / target, format=target)
    with np.load(tmp_path / "mjlab") as ours, np.load(tmp_path / "beyondmimic") as isaac:
        linear = np.gradient(ours["body_pos_w"].astype(float), 1 / 50, axis=0)
        np.testing.assert_allclose(ours["body_lin_vel_w"][2:-2], linear[2:-2], atol=5e-3)
        turns = Rotation.from_quat(ours["body_quat_w"].reshape(-1, 4).astype(float), scalar_first=True).as_matrix()
        turns = turns.reshape(200, -1, 3, 3)
        spin = np.gradient(turns, 1 / 50, axis=0) @ np.swapaxes(turns, 2, 3)
        angular = np.stack([spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]], axis=-1)
        np.testing.assert_allclose(ours["body_ang_vel_w"][2:-2], angular[2:-2], atol=2e-2)
        pelvis, torso = 0, g1.body_names.index("torso_link")
        com = ours["body_pos_w"][:, torso] + turns[:, torso] @ g1.model.body_ipos[torso + 1]
        got = isaac["body_lin_vel_w"][2:-2, isaac_bodies(g1).index("torso_link")]
        np.testing.assert_allclose(got, np.gradient(com, 1 / 50, axis=0)[2:-2], atol=5e-3)
        np.testing.assert_array_equal(isaac["body_quat_w"][:, pelvis], ours["body_quat_w"][:, pelvis])


def test_phc_is_read_by_joblib(g1: Robot, tmp_path: Path) -> None:
    path, _ = make("phc", g1, tmp_path)
    write_clip(read_clip(path, g1), tmp_path / "out.pkl")
    before, after = joblib.load(path)["a_walk"], joblib.load(tmp_path / "out.pkl")["a_walk"]
    assert list(before) == list(after)
    for key in before:
        np.testing.assert_allclose(after[key], before[key], atol=1e-6)
        assert getattr(after[key], "dtype", type(after[key])) == getattr(before[key], "dtype", type(before[key]))
