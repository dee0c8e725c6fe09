"""DeepMimic clips: kinematics, frames of any duration, cycles."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from human_files import deepmimic, deepmimic_row

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.human import is_human, read_human
from gmr_traj.formats.human.deepmimic import read

THIGH, SHIN, HIP = 0.421546, 0.40987, 0.084887  # of configs/deepmimic_skeleton.toml


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "clip.txt"
    path.write_text(text)
    return path


def test_a_bent_knee_takes_the_shin_back_and_z_is_up(tmp_path: Path) -> None:
    bent = -np.pi / 2
    path = write(tmp_path, deepmimic([deepmimic_row(0.1, 0.5, bent), deepmimic_row(0.0, 0.5, bent)]))
    assert is_human(path)
    human = read_human(path, fps=30.0)
    assert (human.rig, human.fps, human.frames) == ("deepmimic", 30.0, 4)
    at = {name: human.positions[0, human.index(name)] for name in human.names}
    # x forward, y left, z up: the right hip is at negative y, the shin points back from the knee.
    np.testing.assert_allclose(at["root"], (0.5, 0, 0.9), atol=1e-12)
    np.testing.assert_allclose(at["right_hip"], (0.5, -HIP, 0.9), atol=1e-12)
    np.testing.assert_allclose(at["right_knee"], (0.5, -HIP, 0.9 - THIGH), atol=1e-12)
    np.testing.assert_allclose(at["right_ankle"], (0.5 - SHIN, -HIP, 0.9 - THIGH), atol=1e-12)
    np.testing.assert_allclose(at["left_ankle"], (0.5, HIP, 0.9 - THIGH - SHIN), atol=1e-12)
    # Joint frames are the file's own, turned to Z up from the left.
    np.testing.assert_allclose(human.quaternions[0, 0], (np.sqrt(0.5), np.sqrt(0.5), 0, 0), atol=1e-12)
    assert human.height == pytest.approx(1.619, abs=1e-3)


def test_resampling_and_cycles(tmp_path: Path) -> None:
    rows = [deepmimic_row(0.5, 0.0, 0.0), deepmimic_row(0.5, 0.3, 0.0), deepmimic_row(0.0, 1.0, 0.0)]
    data = deepmimic(rows, "wrap").encode()
    once, twice = (read(data, 4.0, cycles) for cycles in (1, 2))
    np.testing.assert_allclose(once.positions[:, 0, 0], [0.0, 0.15, 0.3, 0.65, 1.0])
    np.testing.assert_allclose(twice.positions[:, 0, 0], [0.0, 0.15, 0.3, 0.65, 1.0, 1.15, 1.3, 1.65, 2.0])
    np.testing.assert_allclose(twice.positions[:, 0, 1], 0.9)
    assert any("resampled to 4" in note for note in once.notes)


def test_frames_of_different_duration(tmp_path: Path) -> None:
    times = np.cumsum([0, 0.02, 0.05, 0.01, 0.02, 0.02, 0.03])
    rows = [deepmimic_row(0.02, 2.0 * t, -t) for t in times]
    for row, lasts in zip(rows[:-1], np.diff(times), strict=True):
        row[0] = float(lasts)
    human = read_human(write(tmp_path, deepmimic(rows)))
    assert human.fps == 50.0  # of the median frame
    np.testing.assert_allclose(human.positions[:, 0, 0], 2.0 * np.arange(human.frames) / 50, atol=1e-12)


def test_what_is_no_cycle_is_not_repeated() -> None:
    rows = [deepmimic_row(0.1, 0.0, 0.0), deepmimic_row(0.0, 0.0, 0.0)]
    with pytest.raises(ClipError, match="not a cycle"):
        read(deepmimic(rows).encode(), 30.0, cycles=2)


def test_quaternions_that_were_interpolated_are_scaled(tmp_path: Path) -> None:
    rows = [deepmimic_row(0.1, 0.0, 0.0) for _ in range(3)]
    rows[1][8] = 0.6
    human = read_human(write(tmp_path, deepmimic(rows)))
    assert any("quaternions of chest scaled" in note for note in human.notes)


def changed(frame: int, column: int, value: object) -> str:
    rows: list = [deepmimic_row(0.1, 0.0, 0.0) for _ in range(3)]
    rows[frame][column] = value
    return json.dumps({"Loop": "none", "Frames": rows})


BROKEN = {
    "cut": (changed(0, 1, 0.0)[:200], "the file may be cut"),
    "no frames": ('{"Loop": "none", "Frames": []}', "the clip has 0 frames"),
    "no list of frames": ('{"Loop": "none"}', 'no list "Frames"'),
    "a short row": ('{"Loop": "none", "Frames": [[1, 2]]}', "frame 0 has 2 values; expected 44"),
    "a row that is none": ('{"Loop": "none", "Frames": [7]}', "frame 0 has 7; expected 44"),
    "no duration": (changed(1, 0, 0.0), "frame 1 lasts 0 s"),
    "a negative duration": (changed(1, 0, -0.1), "frame 1 lasts -0.1 s"),
    "an endless frame": (changed(1, 0, 1e5), "frame 1 lasts 100000 s"),
    "not a number": (changed(2, 3, float("nan")), "frame 2: Frames has values that are not finite"),
    "text": (changed(2, 3, "x"), "not numbers"),
    "a list": (changed(2, 3, [1]), "not a table of numbers"),
    "too large for a number": (changed(2, 3, 10**400), "not numbers"),
    "no quaternion": (changed(1, 4, 0.0), "frame 1: the quaternion of root has length 0.0000"),
    "nothing but brackets": ('{"Loop":' + "[" * 100_000, "the file may be cut"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_broken_files_say_what_is_wrong(what: str, tmp_path: Path) -> None:
    text, message = BROKEN[what]
    path = write(tmp_path, text)
    with pytest.raises(ClipError, match=re.escape(message)) as caught:
        read_human(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_frame_rate_that_is_none(tmp_path: Path) -> None:
    path = write(tmp_path, changed(0, 1, 0.0))
    for fps in (0.0, -1.0, float("nan"), 1e9):
        with pytest.raises(ClipError, match="set --fps"):
            read_human(path, fps=fps)
