"""Files are written whole or not at all, and the parts of which readers and writers consist do what they say."""

from __future__ import annotations

import io
import os
import stat
import zipfile
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from clip_files import FILES, gmr, holosoma, project, squats
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gmr_traj import atomic
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import Clip, csv_file, npz_file, read_clip, write_clip
from gmr_traj.formats.body_velocities import body_velocities, finite_differences
from gmr_traj.formats.fields import like_fps
from gmr_traj.kinematics.mujoco_kinematics import body_jacobian
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_a_failed_write_leaves_nothing(error: type[BaseException], tmp_path: Path) -> None:
    target = tmp_path / "clip"
    for before in (None, b"old"):
        if before is not None:
            target.write_bytes(before)
        with pytest.raises(error), atomic.write(target) as stream:
            stream.write(b"half")
            raise error
        assert [path.name for path in tmp_path.iterdir()] == ([] if before is None else ["clip"])
        assert before is None or target.read_bytes() == before


def test_a_write_appears_at_its_end(tmp_path: Path) -> None:
    target = tmp_path / "clip"
    target.write_bytes(b"old")
    with atomic.write(target) as stream:
        stream.write(b"new")
        assert target.read_bytes() == b"old"
    assert target.read_bytes() == b"new"
    assert [path.name for path in tmp_path.iterdir()] == ["clip"]
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(target.stat().st_mode) == 0o666 & ~mask


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "link").symlink_to("real")
    with atomic.write(tmp_path / "link") as stream:
        stream.write(b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


def test_where_nothing_can_be_written(tmp_path: Path) -> None:
    for path, message in ((tmp_path / "no" / "clip", "No such file"), (tmp_path, "it is a folder")):
        with pytest.raises(GmrTrajError, match=message), atomic.write(path):
            pytest.fail("the block must not run")


def test_npz_carries_no_clock_time() -> None:
    stream = io.BytesIO()
    npz_file.save(stream, {"file": np.zeros(2), "fps": 30})  # `file` is a parameter of numpy.savez
    with zipfile.ZipFile(stream) as archive:
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert list(npz_file.load(stream.getvalue())) == ["file", "fps"]


def test_npz_that_claims_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.BytesIO()
    np.savez(stream, a=np.zeros(3))
    for old, new in ((b"(3,)", b"(9,)"), (b"(3,)", b"(-3,"), (b"'<f8'", b"'|O8'")):
        with pytest.raises(ClipError):
            npz_file.load(stream.getvalue().replace(old, new))
    packed = io.BytesIO()
    np.savez_compressed(packed, a=np.zeros(100_000))
    monkeypatch.setattr("gmr_traj.formats.size_limit.MAX_BYTES", 2**19)
    with pytest.raises(ClipError, match="content takes 1 MiB"):
        npz_file.load(packed.getvalue())


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=8))
def test_csv_is_exact(values: list[float]) -> None:
    stream = io.BytesIO()
    csv_file.save(stream, csv_file.Table(np.array([values, values]), None))
    assert np.array_equal(csv_file.load(stream.getvalue()).rows, [values, values])


@pytest.mark.parametrize(
    ("before", "fps", "after"),
    [
        (30, 30.0, 30),
        (30, 25.0, 25),
        (30, 29.97, 29.97),
        (29.9, 30.0, 30.0),
        ([50], 30.0, [30]),
        (np.float64(29.9), 30.0, np.float64(30)),
        (np.array([50]), 50.0, np.array([50])),
        (np.array([50]), 29.5, np.array([29.5])),
        (np.float32(30), 25.0, np.float32(25)),
        (None, 50.0, 50),
        (None, 29.9, 29.9),
    ],
)
def test_frame_rates_keep_their_kind(before: object, fps: float, after: object) -> None:
    got = like_fps(before, fps)
    assert type(got) is type(after)
    assert np.array_equal(np.asarray(got), np.asarray(after))
    assert np.shape(got) == np.shape(after)


def test_velocities_are_exact_for_a_steady_motion(g1: Robot) -> None:
    """A base that turns and moves steadily, joints that move steadily: central differences are exact."""
    frames, fps = 9, 40.0
    time = np.arange(frames)[:, None] / fps
    rate = np.concatenate([[0.4, -0.2, 0.1], [0.5, -1.2, 0.8], np.linspace(-1.0, 1.0, g1.dof)])
    start = np.array(g1.nominal)
    turn = Rotation.from_rotvec(time * rate[3:6]) * Rotation.from_euler("xyz", [0.1, 0.2, 0.3])
    joints = start[7:] + time * rate[6:]
    qpos = np.hstack([start[:3] + time * rate[:3], turn.as_quat(scalar_first=True), joints])
    velocity = finite_differences(qpos, fps)
    np.testing.assert_allclose(velocity, np.tile(rate, (frames, 1)), atol=1e-12)
    linear, angular = body_velocities(g1, qpos, velocity)
    for b in (0, 6, 22):
        expected = body_jacobian(g1, qpos[4], g1.body_names[b]) @ rate
        np.testing.assert_allclose(np.concatenate([linear[4, b], angular[4, b]]), expected, atol=1e-12)
    for count in (1, 2):
        short = finite_differences(qpos[:count], fps)
        np.testing.assert_allclose(short, np.tile(rate if count == 2 else 0 * rate, (count, 1)), atol=1e-12)


def test_everything_a_clip_holds_is_in_our_own_format(g1: Robot, tmp_path: Path) -> None:
    project(g1, squats(g1), tmp_path / "in.npz")
    clip = read_clip(tmp_path / "in.npz", g1)
    frames = clip.motion.frames
    targets = BodyTargets(
        names=("pelvis", "torso_link"),
        positions=np.random.default_rng(0).normal(size=(frames, 2, 3)),
        quaternions=np.tile([1.0, 0, 0, 0], (frames, 2, 1)),
        position_weights=np.array([1.0, 2.0]),
        orientation_weights=np.array([0.0, 1.0]),
    )
    schedule = ContactSchedule(frames, clip.motion.fps, (Stance("left", 0, g1.soles[0].parts[0], 2, 9),), 0.01)
    full = replace(clip, references=targets, schedule=schedule)
    assert write_clip(full, tmp_path / "out.npz", robot=g1) == ()
    again = read_clip(tmp_path / "out.npz", g1)
    assert again.schedule == schedule
    assert again.references is not None
    assert again.references.names == targets.names
    for field in ("positions", "quaternions", "position_weights", "orientation_weights"):
        assert np.array_equal(getattr(again.references, field), getattr(targets, field))
    notes = write_clip(full, tmp_path / "out", format="gmr", robot=g1)
    assert notes == ("gmr does not hold the contact schedule", "gmr does not hold the reference placements")


def test_references_are_checked() -> None:
    good = {
        "names": ("a", "b"),
        "positions": np.zeros((3, 2, 3)),
        "quaternions": np.tile([1.0, 0, 0, 0], (3, 2, 1)),
        "position_weights": np.ones(2),
        "orientation_weights": np.ones(2),
    }
    BodyTargets(**good)
    for field, value, message in (
        ("names", ("a", "a"), "'a' is named twice"),
        ("positions", np.zeros((3, 2)), "positions has shape"),
        ("quaternions", np.zeros((3, 2, 4)), "frame 0: quaternion of 'a' has length 0"),
        ("position_weights", np.array([1.0, -1.0]), "position_weights of 'b' is negative"),
        ("positions", np.full((3, 2, 3), np.nan), "not finite"),
    ):
        with pytest.raises(ClipError, match=message):
            BodyTargets(**{**good, field: value})


def test_what_another_format_cannot_hold_is_said(g1: Robot, tmp_path: Path) -> None:
    holosoma(g1, squats(g1), tmp_path / "in.npz")
    clip = read_clip(tmp_path / "in.npz", g1)
    notes = write_clip(clip, tmp_path / "out", format="unitree-csv", robot=g1)
    assert notes[0] == "csv does not hold the frame rate: read it with --fps 50"
    assert "the object's columns, object_pos_w" in notes[1]


def test_a_body_fixed_to_nothing(g1: Robot, tmp_path: Path) -> None:
    gmr(g1, squats(g1), tmp_path / "in.pkl")
    clip = read_clip(tmp_path / "in.pkl", g1)
    content = dict(clip.extras["content"])
    content["local_body_pos"] = np.array(content["local_body_pos"])
    content["local_body_pos"][:, -2, 0] += np.linspace(0, 1, clip.motion.frames)
    loose = replace(clip, extras={**clip.extras, "content": content})
    (note,) = write_clip(loose, tmp_path / "out.pkl", robot=g1)
    assert "'left_toe_link' is not fixed to any body" in note
    assert read_clip(tmp_path / "out.pkl", g1).extras["content"]["local_body_pos"] is None


def test_the_robot_is_found_by_its_name(g1: Robot, tmp_path: Path) -> None:
    project(g1, squats(g1), tmp_path / "in.npz")
    clip = read_clip(tmp_path / "in.npz", g1)
    write_clip(clip, tmp_path / "a", format="mjlab")
    write_clip(clip, tmp_path / "b", format="mjlab", robot=g1)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_clips_are_checked(g1: Robot, tmp_path: Path) -> None:
    project(g1, squats(g1), tmp_path / "in.npz")
    motion = read_clip(tmp_path / "in.npz", g1).motion
    with pytest.raises(ClipError, match="there is no format 'bvh'"):
        Clip(motion, "bvh")
    with pytest.raises(ClipError, match="schedule has 5 frames, the motion 24"):
        Clip(motion, "gmr", schedule=ContactSchedule(5, 30.0, ()))
    with pytest.raises(ClipError, match="there is no format 'bvh'"):
        write_clip(Clip(motion, "gmr-traj"), tmp_path / "out", format="bvh")
    assert not (tmp_path / "out").exists()


def test_samples_stand_on_the_floor(g1: Robot) -> None:
    """The samples these tests rest on: soles level at z = 0 in every frame."""
    data = mujoco.MjData(g1.model)
    for q in squats(g1):
        data.qpos[:] = q
        mujoco.mj_kinematics(g1.model, data)
        for sole in g1.soles:
            points = data.body(sole.body).xpos + sole.points @ data.body(sole.body).xmat.reshape(3, 3).T
            np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-9)
    assert set(FILES)
