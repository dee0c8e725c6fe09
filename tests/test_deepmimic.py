"""The reader of DeepMimic clips behind the example, on a person of three bones."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))
from deepmimic import COLUMNS, HINGES, read_bones, read_clip

URDF = """<robot name="person"><link name="base"/>
<joint name="root"><parent link="base"/><origin xyz="0 0 0"/></joint>
<joint name="right_hip"><parent link="root"/><origin xyz="0 0 0.4"/></joint>
<joint name="right_knee"><parent link="right_hip"/><origin xyz="0 -1.6 0"/></joint>
<joint name="right_ankle"><parent link="right_knee"/><origin xyz="0 -1.6 0"/></joint>
</robot>\0"""


def row(duration: float, x: float, knee: float) -> list[float]:
    """A frame of a person upright at x whose right knee is bent; rotations are wxyz, hinges one angle."""
    local: list[float] = []
    for name in COLUMNS:
        local += [knee if name == "right_knee" else 0.0] if name in HINGES else [1.0, 0.0, 0.0, 0.0]
    return [duration, x, 0.9, 0.0, 1.0, 0.0, 0.0, 0.0, *local]


@pytest.fixture
def person(tmp_path):
    (tmp_path / "humanoid.urdf").write_text(URDF)
    return read_bones(tmp_path / "humanoid.urdf")


def write(path: Path, frames: list[list[float]], loop: str) -> Path:
    path.write_text(json.dumps({"Loop": loop, "Frames": frames}))
    return path


def test_bones_are_a_quarter_of_the_urdf_s(person):
    assert list(person) == ["right_hip", "right_knee", "right_ankle"]
    np.testing.assert_allclose(person["right_knee"][1], [0.0, -0.4, 0.0])


def test_a_bent_knee_takes_the_shin_back_and_z_is_up(person, tmp_path):
    clip = write(tmp_path / "clip.txt", [row(0.1, 0.5, -np.pi / 2), row(0.0, 0.5, -np.pi / 2)], "none")
    human = read_clip(clip, person, 30.0)
    assert human.names == ("root", "right_hip", "right_knee", "right_ankle")
    # x forward, y left, z up: the right hip is at negative y, the shin points back from the knee.
    expected = [[0.5, 0.0, 0.9], [0.5, -0.1, 0.9], [0.5, -0.1, 0.5], [0.1, -0.1, 0.5]]
    np.testing.assert_allclose(human.positions[0], expected, atol=1e-12)
    np.testing.assert_allclose(human.quaternions[0, 0], [1.0, 0.0, 0.0, 0.0], atol=1e-12)


def test_resampling_and_cycles(person, tmp_path):
    clip = write(tmp_path / "clip.txt", [row(0.5, 0.0, 0.0), row(0.5, 0.3, 0.0), row(0.0, 1.0, 0.0)], "wrap")
    once, twice = (read_clip(clip, person, 4.0, cycles) for cycles in (1, 2))
    np.testing.assert_allclose(once.positions[:, 0, 0], [0.0, 0.15, 0.3, 0.65, 1.0])
    np.testing.assert_allclose(twice.positions[:, 0, 0], [0.0, 0.15, 0.3, 0.65, 1.0, 1.15, 1.3, 1.65, 2.0])
    np.testing.assert_allclose(twice.positions[:, 0, 2], 0.9)


def test_what_is_no_cycle_is_not_repeated(person, tmp_path):
    clip = write(tmp_path / "clip.txt", [row(0.1, 0.0, 0.0), row(0.0, 0.0, 0.0)], "none")
    with pytest.raises(ValueError, match="not a cycle"):
        read_clip(clip, person, 30.0, cycles=2)
