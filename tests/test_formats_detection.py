"""Questions a file leaves open: answered from the robot where that can be, otherwise an error that names the flag."""

from __future__ import annotations

import itertools
import pickle
from pathlib import Path

import joblib
import numpy as np
import pytest
from clip_files import (
    FILES,
    beyondmimic,
    gmr,
    isaac_bodies,
    isaac_joints,
    mjlab,
    phc,
    project,
    protomotions_csv,
    squats,
    tracking_arrays,
    unitree_csv,
)
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import read_clip, write_clip
from gmr_traj.formats.body_match import _in_order
from gmr_traj.formats.standing import StandingTest
from gmr_traj.formats.tree_order import breadth_first_bodies, breadth_first_joints
from gmr_traj.robot import Robot


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return tmp_path / "clip"


@pytest.mark.parametrize(("tilt", "heading"), [(0.0, 0.7), (0.3, -1.2)])
def test_oddness_in_closed_form(tilt: float, heading: float, g1: Robot) -> None:
    """A still robot, leant over: its base and its soles are tilted by that angle, and nothing slips."""
    frames = 5
    test = StandingTest(g1, np.tile(g1.nominal[7:], (frames, 1)), 30.0)
    turn = Rotation.from_euler("z", heading) * Rotation.from_rotvec([tilt, 0.0, 0.0])
    quaternion = np.tile(turn.as_quat(scalar_first=True), (frames, 1))
    still = np.tile([0.0, 0.0, 1.0], (frames, 1))
    degrees = np.degrees(tilt)
    assert test.oddness(still, quaternion) == pytest.approx(degrees / 20 + degrees / 10, abs=1e-6)
    moving = still + np.arange(frames)[:, None] * [0.01, 0.0, 0.0]  # 0.3 m/s
    assert test.oddness(moving, quaternion) == pytest.approx(degrees / 20 + degrees / 10 + 0.3 / 0.2, abs=1e-6)
    if not tilt:
        raised = g1.nominal[:3] + [0.0, 0.0, 0.25]
        assert test.lowest_sole(np.tile(raised, (frames, 1)), quaternion) == pytest.approx(0.25, abs=1e-9)


def test_a_clip_far_above_the_floor_is_noted(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    qpos[:, 2] += 1.5
    gmr(g1, qpos, clip)
    assert "the lowest sole is 1.50 m above the floor (median)" in read_clip(clip, g1).notes


def test_trailing_commas(g1: Robot, clip: Path) -> None:
    unitree_csv(g1, squats(g1), clip)
    before = read_clip(clip, g1).motion.qpos
    clip.write_text(clip.read_text().replace("\n", ",\n"))
    assert np.array_equal(read_clip(clip, g1).motion.qpos, before)


def test_breadth_first_is_isaacs_order(g1: Robot) -> None:
    assert list(breadth_first_joints(g1)) == isaac_joints(g1)
    assert list(breadth_first_bodies(g1)) == isaac_bodies(g1)


@pytest.mark.parametrize("seed", range(20))
def test_match_in_order_is_the_best_one(seed: int) -> None:
    """Against every increasing choice of columns."""
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(1, 5))
    cost = rng.random((rows, int(rng.integers(rows, 8))))
    every = itertools.combinations(range(cost.shape[1]), rows)
    best = min(every, key=lambda columns: cost[np.arange(rows), list(columns)].sum())
    assert _in_order(cost) == (list(best), cost[np.arange(rows), list(best)].max())


@pytest.mark.parametrize("heading", [-2.5, -0.8, 0.3, 0.8, 1.6])
def test_quaternion_order_of_csv(heading: float, g1: Robot, clip: Path) -> None:
    for write, order in ((unitree_csv, "xyzw"), (protomotions_csv, "wxyz")):
        write(g1, squats(g1, heading=heading), clip)
        found = read_clip(clip, g1)
        assert found.extras["quaternion"] == order
        assert any(f"quaternion order {order}" in note for note in found.notes)


def test_quaternion_order_that_cannot_be_told(g1: Robot, clip: Path) -> None:
    """Facing along x without leaning, both readings stand: they differ by half a turn."""
    qpos = squats(g1, heading=0.0)
    unitree_csv(g1, qpos, clip)
    with pytest.raises(ClipError, match=r"clip: .*set --quaternion xyzw or --quaternion wxyz"):
        read_clip(clip, g1)
    assert np.abs(read_clip(clip, g1, quaternion="xyzw").motion.qpos - qpos).max() < 1e-6
    assert read_clip(clip, g1, quaternion="wxyz").format == "protomotions-csv"
    assert np.abs(read_clip(clip, g1, format="unitree-csv").motion.qpos - qpos).max() < 1e-6


def test_wrong_quaternion_order_in_a_format_that_defines_it(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    for write in (gmr, project, phc):
        swapped = np.array(qpos)  # so that the writer's own order of the columns comes out as the other one
        swapped[:, 3:7] = np.roll(qpos[:, 3:7], -1 if write is project else 1, axis=1)
        write(g1, swapped, clip.with_suffix(".npz"))
        with pytest.raises(ClipError, match=r"looks like (wxyz|xyzw).*set --quaternion \1"):
            read_clip(clip.with_suffix(".npz"), g1)
        order = "xyzw" if write is project else "wxyz"
        found = read_clip(clip.with_suffix(".npz"), g1, quaternion=order)
        assert np.abs(found.motion.qpos - qpos).max() < 2e-7
        write_clip(found, clip, robot=g1)  # goes back in the order it came in
        assert np.abs(read_clip(clip, g1, quaternion=order).motion.qpos - qpos).max() < 2e-7


def test_quaternions_that_are_none(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    qpos[5, 3:7] *= 0.5
    unitree_csv(g1, qpos, clip)
    with pytest.raises(ClipError, match=r"frame 5: the base quaternion has length 0\.5"):
        read_clip(clip, g1)


def test_smoothed_quaternions_are_scaled_and_noted(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    qpos[:, 3:7] *= 0.97
    gmr(g1, qpos, clip)
    found = read_clip(clip, g1)
    assert np.abs(np.linalg.norm(found.motion.qpos[:, 3:7], axis=1) - 1).max() < 1e-15
    assert any("unit length" in note for note in found.notes)


def test_breadth_first_csv_is_found(g1: Robot, clip: Path) -> None:
    """Isaac's order leaves no joint far out of its range, but the feet slide and are not level."""
    qpos = squats(g1)
    columns = [7 + g1.joint_names.index(name) for name in isaac_joints(g1)]
    unitree_csv(g1, np.hstack([qpos[:, :7], qpos[:, columns]]), clip)
    with pytest.raises(ClipError, match="breadth-first"):
        read_clip(clip, g1)


def test_named_joints_in_any_order(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    columns = [7 + g1.joint_names.index(name) for name in isaac_joints(g1)]
    np.savez(clip, qpos=np.hstack([qpos[:, :7], qpos[:, columns]]), fps=30, joint_names=np.array(isaac_joints(g1)))
    found = read_clip(clip.with_suffix(".npz"), g1)
    assert found.motion.joint_names == g1.joint_names
    assert np.abs(found.motion.qpos - qpos).max() < 1e-15


def test_joints_left_out_by_name(g1: Robot, clip: Path) -> None:
    """The waist and the arms may be missing, a leg's joint may not."""
    qpos = squats(g1)
    for left_out, complete in (("waist_yaw_joint", True), ("left_knee_joint", False)):
        kept = [name for name in g1.joint_names if name != left_out]
        columns = [7 + g1.joint_names.index(name) for name in kept]
        np.savez(clip, qpos=np.hstack([qpos[:, :7], qpos[:, columns]]), fps=30, joint_names=np.array(kept))
        if complete:
            assert read_clip(clip.with_suffix(".npz"), g1).motion.joint_names == tuple(kept)
        else:
            with pytest.raises(ClipError, match="no joint 'left_knee_joint'"):
                read_clip(clip.with_suffix(".npz"), g1)


def test_joints_far_out_of_range(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    qpos[:, 7 + g1.joint_names.index("left_knee_joint")] = -1.5
    gmr(g1, qpos, clip)
    with pytest.raises(ClipError, match=r"left_knee_joint is up to 1\.4 rad outside its range"):
        read_clip(clip, g1)


def test_mixed_orders_are_refused(g1: Robot, clip: Path) -> None:
    arrays = tracking_arrays(g1, squats(g1), list(g1.joint_names), isaac_bodies(g1), 50)
    np.savez(clip, **arrays)
    with pytest.raises(ClipError, match="joints are in depth-first order but the bodies in breadth-first order"):
        read_clip(clip.with_suffix(".npz"), g1)


def test_bodies_of_another_motion_are_refused(g1: Robot, clip: Path) -> None:
    arrays = tracking_arrays(g1, squats(g1), list(g1.joint_names), list(g1.body_names), 50)
    arrays["joint_pos"] = arrays["joint_pos"][::-1] + 0.3
    np.savez(clip, **arrays)
    with pytest.raises(ClipError, match="does not belong to joint_pos"):
        read_clip(clip.with_suffix(".npz"), g1)


def test_format_against_the_bodies(g1: Robot, clip: Path) -> None:
    beyondmimic(g1, squats(g1), clip.with_suffix(".npz"))
    with pytest.raises(ClipError, match="order of beyondmimic"):
        read_clip(clip.with_suffix(".npz"), g1, format="mjlab")


def test_a_still_clip_at_zero_has_the_order_of_its_bodies(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    qpos[:, 7:] = 0.0
    for write in (mjlab, beyondmimic):
        write(g1, qpos, clip.with_suffix(".npz"))
        assert read_clip(clip.with_suffix(".npz"), g1).format == write.__name__


def test_degrees_and_centimetres(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    unitree_csv(g1, np.hstack([100 * qpos[:, :3], qpos[:, 3:7], np.degrees(qpos[:, 7:])]), clip)
    found = read_clip(clip, g1)
    assert np.abs(found.motion.qpos - qpos).max() < 1e-6
    assert any("degrees" in note for note in found.notes)
    assert any("centimetres" in note for note in found.notes)


def test_y_up(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    lie = Rotation.from_euler("x", -90, degrees=True)
    qpos[:, :3] = lie.apply(qpos[:, :3])
    qpos[:, 3:7] = (lie * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    project(g1, qpos, clip.with_suffix(".npz"))
    with pytest.raises(ClipError, match="Y-up"):
        read_clip(clip.with_suffix(".npz"), g1, quaternion="wxyz")


def test_frame_rate(g1: Robot, clip: Path) -> None:
    qpos = squats(g1)
    unitree_csv(g1, qpos, clip)
    assert read_clip(clip, g1, fps=60).motion.fps == 60.0
    assert any("30 Hz by convention" in note for note in read_clip(clip, g1).notes)
    for fps, message in ((0.02, "is it the time of a frame"), (np.nan, "frame rate is nan"), (None, "does not say")):
        np.savez(clip, qpos=qpos, **({} if fps is None else {"fps": fps}))
        with pytest.raises(ClipError, match=rf"{message}.*--fps"):
            read_clip(clip.with_suffix(".npz"), g1)
        assert read_clip(clip.with_suffix(".npz"), g1, fps=25).motion.fps == 25.0


def test_another_robot(g1: Robot, talos: Robot, clip: Path) -> None:
    project(g1, squats(g1), clip.with_suffix(".npz"))
    with pytest.raises(ClipError, match=r"of robot 'unitree_g1', not .*--robot"):
        read_clip(clip.with_suffix(".npz"), talos)
    gmr(g1, squats(g1), clip)
    with pytest.raises(ClipError, match=r"29 joints, .* has \d+.*--robot"):
        read_clip(clip, talos)


@pytest.mark.parametrize("name", sorted(set(FILES) - {"bones-csv"}))
def test_other_humanoids(name: str, talos: Robot, tmp_path: Path) -> None:
    """Every format holds every humanoid; its orders are found from its own kinematics."""
    path = tmp_path / "in.npz"
    qpos = squats(talos, heading=1.0)
    np.savez(path, qpos=qpos, fps=40.0, joint_names=np.array(talos.joint_names), robot=talos.name)
    clip = read_clip(path, talos)
    write_clip(clip, tmp_path / "out", format=name, robot=talos)
    again = read_clip(tmp_path / "out", talos, fps=40.0)
    assert again.format == name
    assert np.abs(again.motion.qpos - qpos).max() < 3e-7


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"poses": np.zeros((4, 72)), "trans": np.zeros((4, 3))}, "human motion"),
        ({"base_frame_pos": np.zeros((4, 3))}, "PyRoki"),
        ({"foo": np.zeros(3), "bar": np.zeros(3)}, "npz holds foo, bar"),
    ],
)
def test_what_is_no_clip(content: dict[str, np.ndarray], message: str, g1: Robot, clip: Path) -> None:
    np.savez(clip, **content)  # type: ignore[arg-type]
    with pytest.raises(ClipError, match=message):
        read_clip(clip.with_suffix(".npz"), g1)


def test_several_clips_in_one_file(g1: Robot, clip: Path) -> None:
    phc(g1, squats(g1), clip)
    content = joblib.load(clip)["a_walk"]
    joblib.dump({"one": content, "two": content}, clip)
    with pytest.raises(ClipError, match=r"holds 2 clips \(one, two\)"):
        read_clip(clip, g1)


def test_files_that_cannot_be_read(g1: Robot, tmp_path: Path) -> None:
    for path, message in ((tmp_path / "none.csv", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(ClipError, match=message):
            read_clip(path, g1)
    for text, message in (("", "empty"), ("a,b\n", "no frames"), ("1,2\n3\n", "not a table"), ("1,2\n", "2 columns")):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(ClipError, match=message):
            read_clip(tmp_path / "bad.csv", g1)
    with pytest.raises(ClipError, match="there is no format 'gmrr'; there are gmr,"):
        read_clip(tmp_path / "bad.csv", g1, format="gmrr")
    with pytest.raises(ClipError, match="no quaternion order 'zyxw'"):
        read_clip(tmp_path / "bad.csv", g1, quaternion="zyxw")


def test_values_that_are_no_motion(g1: Robot, clip: Path) -> None:
    good = squats(g1)
    for value in (np.nan, np.inf, 1e30):
        qpos = np.array(good)
        qpos[7, 9] = value
        project(g1, qpos, clip.with_suffix(".npz"))
        with pytest.raises(ClipError, match="frame 7"):
            read_clip(clip.with_suffix(".npz"), g1)
    content = {"root_pos": "here", "root_rot": good[:, 3:7], "dof_pos": good[:, 7:], "fps": 30}
    clip.write_bytes(pickle.dumps(content))
    with pytest.raises(ClipError, match="root_pos"):
        read_clip(clip, g1)
