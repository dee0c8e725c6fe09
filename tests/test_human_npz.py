"""gmr-traj's own npz of a human motion, and files that are no human motion at all."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from human_files import bvh_file, neutral_file

from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats.human import is_human, read_human, write_human_npz


def test_what_was_written_is_read(tmp_path: Path) -> None:
    bvh_file(tmp_path / "clip.bvh")
    human = read_human(tmp_path / "clip.bvh")
    write_human_npz(human, tmp_path / "clip.npz")
    again = read_human(tmp_path / "clip.npz")
    np.testing.assert_array_equal(again.positions, human.positions)
    np.testing.assert_allclose(again.quaternions, human.quaternions, atol=1e-15)
    assert (again.names, again.parents, again.rig) == (human.names, human.parents, human.rig)
    assert (again.fps, again.height) == (human.fps, human.height)
    assert set(again.contacts) == set(human.contacts)
    for name, touching in human.contacts.items():
        np.testing.assert_array_equal(again.contacts[name], touching)
    write_human_npz(human, tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "clip.npz").read_bytes()


def test_everything_in_the_file_is_taken(tmp_path: Path) -> None:
    neutral_file(tmp_path / "clip.npz")
    human = read_human(tmp_path / "clip.npz")
    assert (human.rig, human.fps, human.height, human.frames) == ("mine", 50.0, 1.72, 20)
    assert human.parents == (-1, 0, 0, 2, 0, 4)
    assert human.contacts["LeftFoot"][0] and not human.contacts["RightFoot"][0]


def test_nothing_is_written_where_it_cannot_be(tmp_path: Path) -> None:
    neutral_file(tmp_path / "clip.npz")
    with pytest.raises(GmrTrajError, match="cannot write"):
        write_human_npz(read_human(tmp_path / "clip.npz"), tmp_path / "none" / "clip.npz")


def edited(tmp_path: Path, **entries: Any) -> Path:
    neutral_file(tmp_path / "clip.npz")
    with np.load(tmp_path / "clip.npz") as archive:
        content = {**archive, **entries}
    np.savez(tmp_path / "clip.npz", **{key: value for key, value in content.items() if value is not None})
    return tmp_path / "clip.npz"


def test_what_is_optional_may_be_missing(tmp_path: Path) -> None:
    human = read_human(edited(tmp_path, joint_parents=None, rig=None, contacts=None, contact_names=None))
    assert (human.rig, human.parents) == ("unknown", (-1,) * 6)
    assert set(human.contacts) == {"LeftFoot", "RightFoot"}
    assert read_human(edited(tmp_path, height=None)).height == pytest.approx((0.05 + 0.82 + 0.6) / 0.89, abs=1e-3)
    with pytest.raises(ClipError, match="set --height"):
        read_human(edited(tmp_path, joint_parents=None, height=None))


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"quaternions": None}, "has no quaternions"),
        ({"fps": None}, "has no fps"),
        ({"fps": 0.0}, "a frame rate of 0"),
        ({"joint_names": np.array(["a", "a", "b", "c", "d", "e"])}, "names 'a' twice"),
        ({"joint_names": np.zeros(6)}, "joint_names is not a list of names"),
        ({"positions": np.zeros((20, 5, 3))}, "positions has shape (20, 5, 3); expected (frames, 6, 3)"),
        ({"positions": np.zeros((0, 6, 3)), "quaternions": np.zeros((0, 6, 4))}, "0 frames of positions"),
        ({"positions": np.full((20, 6, 3), np.nan)}, "frame 0: positions has values that are not finite"),
        ({"quaternions": np.zeros((20, 6, 4))}, "frame 0: the quaternion of 'Hips' has length 0.0000"),
        ({"joint_parents": np.array([-1, 0, 3, 2, 0, 4])}, "joint_parents[2] is 3"),
        ({"joint_parents": np.zeros(6)}, "joint_parents is float64"),
        ({"height": -1.0}, "a height of -1 m"),
        ({"rig": np.array(7)}, "rig is not text"),
        ({"contact_names": None}, "belong together"),
        ({"contact_names": np.array(["LeftFoot", "x"])}, "'x', which is no joint"),
        ({"contacts": np.full((20, 2), 7)}, "other than true and false"),
        ({"contacts": np.zeros((20, 3))}, "contacts has shape (20, 3)"),
    ],
)
def test_wrong_entries(entries: dict, message: str, tmp_path: Path) -> None:
    path = edited(tmp_path, **entries)
    with pytest.raises(ClipError, match=re.escape(message)) as caught:
        read_human(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("data", [b"", b"\x00\xff" * 300, b"hello", b"PK\x03\x04", b"{}", b"\x93NUMPY", b"1,2,3\n"])
def test_no_human_motion(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "clip"
    path.write_bytes(data)
    assert not is_human(path)
    with pytest.raises(ClipError, match=re.escape(str(path))):
        read_human(path)


def test_a_robot_clip_is_no_human_motion(tmp_path: Path) -> None:
    np.savez(tmp_path / "clip.npz", qpos=np.zeros((3, 36)), fps=30, joint_names=np.array(["a"]))
    assert not is_human(tmp_path / "clip.npz")
    with pytest.raises(ClipError, match="this npz holds qpos, fps, joint_names"):
        read_human(tmp_path / "clip.npz")
    assert not is_human(tmp_path / "none.npz")
    assert not is_human(tmp_path)
    with pytest.raises(ClipError, match="cannot read"):
        read_human(tmp_path / "none.npz")
