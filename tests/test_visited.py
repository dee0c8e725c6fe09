"""What is known of a motion is found once, and cut with it."""

from __future__ import annotations

import numpy as np
import pytest
from test_collision_broadphase import smooth_walk

from gmr_traj import visited
from gmr_traj.collision.broadphase import candidates
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.visited import Visited


def walk(g1: Robot) -> RobotMotion:
    return RobotMotion(smooth_walk(g1, 60, seed=5), 30.0, g1.joint_names, g1.name)


@pytest.mark.parametrize(("start", "stop"), [(0, 60), (0, 7), (13, 41), (59, 60)])
def test_a_part_knows_what_it_would_find_by_itself(g1: Robot, start: int, stop: int) -> None:
    motion = walk(g1)
    part = Visited(g1, motion).part(start, stop)
    np.testing.assert_array_equal(part.motion.qpos, motion.qpos[start:stop])
    alone = placements(g1, motion.qpos[start:stop])
    for found, expected in zip(part.placements, alone, strict=True):
        np.testing.assert_array_equal(found, expected)
    expected = candidates(g1, *alone, 0.05)
    assert len(expected) > 3
    found = part.close(0.05)
    assert [c.pair for c in found] == [c.pair for c in expected]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.frames, other.frames)
        np.testing.assert_allclose(one.clearance, other.clearance, atol=1e-12)


def test_parts_of_parts(g1: Robot) -> None:
    whole = Visited(g1, walk(g1))
    once, twice = whole.part(20, 40), whole.part(10, 50).part(10, 30)
    np.testing.assert_array_equal(once.placements[0], twice.placements[0])
    for one, other in zip(once.close(0.05), twice.close(0.05), strict=True):
        assert one.pair == other.pair
        np.testing.assert_array_equal(one.frames, other.frames)


def test_the_search_is_made_once_a_margin(g1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    margins = []

    def counted(robot: Robot, *arguments: object) -> list[visited.Candidate]:
        margins.append(arguments[-1])
        return candidates(robot, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(visited, "candidates", counted)
    whole = Visited(g1, walk(g1))
    for part in (whole.part(0, 30), whole.part(30, 60), whole):
        part.close(0.01)
        part.close(0.02)
    assert margins == [0.01, 0.02]
