"""What is made before the processes of a batch's clips are forked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gmr_traj.cli import batch_warm
from gmr_traj.cli.batch_arguments import Batch
from gmr_traj.cli.batch_work import Steps
from gmr_traj.formats import read_clip, write_clip
from gmr_traj.resources import folder
from gmr_traj.robot_loading import load_robot, reduce_robot

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


@pytest.fixture(autouse=True)
def nothing_made(monkeypatch):
    monkeypatch.setattr(batch_warm, "_made", {})


def test_a_clip_is_the_same_with_what_was_made_before(tmp_path, g1):
    punch = read_clip(EXAMPLES / "punch.npz", g1)
    path = tmp_path / "punch.npz"
    write_clip(replace(punch, motion=punch.motion.with_qpos(punch.motion.qpos[:24]), schedule=None), path, robot=g1)
    batch = Batch(inputs=("a",), out=tmp_path)
    work = Steps(
        name="clip",
        refine=batch.of_clip(path, False, None),
        versions={},
        steps=batch.steps,
        verify=batch.of_verify(path),
    )
    found = []
    for name in ("cold", "warm"):
        (tmp_path / name).mkdir()
        found.append((work.carry_out(tmp_path / name).content, (tmp_path / name / "clip.npz").read_bytes()))
        work.prepare()
    assert found[0] == found[1]


def test_one_is_made_for_each_robot_and_problem_that_ship(g1):
    for _ in range(2):
        batch_warm.prepare("unitree_g1", "refine")
    made = batch_warm.prepared(g1, "unitree_g1", "refine")
    assert made is not None and made.robot.joint_names == g1.joint_names and len(batch_warm._made) == 1
    assert batch_warm.prepared(g1, "unitree_g1", "refine_physical") is None
    fewer = reduce_robot(g1, [name for name in g1.joint_names if "wrist" not in name])
    assert batch_warm.prepared(fewer, "unitree_g1", "refine") is None
    # Files of the user's own may hold anything.
    own = str(folder("problems") / "refine.toml")
    batch_warm.prepare("unitree_g1", own)
    batch_warm.prepare(str(load_robot("unitree_g1").path), "refine")
    assert len(batch_warm._made) == 1


def test_what_does_not_refine_needs_nothing(tmp_path):
    batch = Batch(inputs=("a",), out=tmp_path, steps=("verify",))
    path = EXAMPLES / "punch.npz"
    refine, verify = batch.of_clip(path, False, None), batch.of_verify(path)
    Steps(name="clip", refine=refine, versions={}, steps=batch.steps, verify=verify).prepare()
    assert not batch_warm._made
