"""Stance anchors: rows from MuJoCo's placements, derivatives, and a skating foot that ends up still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from metrics_toy import FPS, both_feet, clip, standing
from optimiser_setup import context_of, jacobian_error, kinematics_of, problem_of, residuals_of, toy, values

from gmr_traj.contacts.detect import sole_points
from gmr_traj.contacts.mask import owners
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.evaluation import evaluate
from gmr_traj.residuals import FrameResidual
from gmr_traj.terms.context import stepped
from gmr_traj.terms.smoothness import Acceleration
from gmr_traj.terms.stance import StanceAnchor, pivots
from gmr_traj.terms.tracking import Tracking
from gmr_traj.whole_clip import Task, solve_clip

TERM = StanceAnchor(horizontal=0.001, vertical=0.002)
HEEL, TOE = (2, 3), (0, 1)


def rolling_foot() -> ContactSchedule:
    """The left foot down whole in frames 2-5, on its toe in 6-7, down again in 9; the right foot never."""
    stances = [Stance("left", k, "heel", 2, 6) for k in HEEL] + [Stance("left", k, "toe", 2, 8) for k in TOE]
    stances.append(Stance("left", 0, "toe", 9, 10))
    return ContactSchedule(10, FPS, tuple(sorted(stances)))


def skating(frames: int, speed: float) -> np.ndarray:
    qpos = standing(frames)
    qpos[:, 0] = speed * np.arange(frames) / FPS
    return qpos


def test_rows_are_points_less_anchors() -> None:
    robot, motion, schedule = toy(), clip(skating(10, 0.3)), rolling_foot()
    found, variables = residuals_of(TERM, context_of(robot, motion, schedule=schedule))
    assert len(found) == 1  # no residual of a foot that never stands
    (residual,) = found
    assert isinstance(residual, FrameResidual)
    assert variables.size == 9 * 10 + 2 * len(schedule.stances)
    np.testing.assert_array_equal(residual.frames, [2, 3, 4, 5, 6, 7, 9])
    x = variables.initial()
    x[: 9 * 10] = 0.1 * np.random.default_rng(0).normal(size=90)
    anchors = x[90:].reshape(-1, 2)
    points = sole_points(stepped(motion, x[:90].reshape(10, 9)), robot)
    rows = values(residual, x).reshape(4, 3, -1)
    weight = residual.weights.reshape(4, 3, -1)
    names = list(residual.rows)
    # A point in swing has no row in the report.
    assert evaluate(residual, x).rows.size == 3 * sum(stance.stop - stance.start for stance in schedule.stances)
    for column, frame in enumerate(residual.frames):
        for k in range(4):
            stance = next((s for s in schedule.stances if s.point == k and s.start <= frame < s.stop), None)
            if stance is None:
                assert not weight[k, :, column].any()
                continue
            # Unknowns are appended sole by sole in the order of the schedule.
            anchor = anchors[schedule.stances.index(stance)]
            point = points[frame, owners(robot).index(("left", k, stance.part))]
            np.testing.assert_allclose(rows[k, :, column], point - [*anchor, 0.0], atol=1e-12)
            np.testing.assert_allclose(weight[k, :, column] * FPS, [1e6, 1e6, 0.25e6])
            assert names[3 * k : 3 * k + 3] == [f"{stance.part} {k} {axis}" for axis in "xyz"]


def test_anchors_start_where_the_point_is() -> None:
    _, variables = residuals_of(TERM, context_of(toy(), clip(standing(10)), schedule=rolling_foot()))
    points = sole_points(clip(standing(1)), toy())
    starts = variables.initial()[90:].reshape(-1, 2)
    for stance, start in zip(rolling_foot().stances, starts, strict=True):
        np.testing.assert_allclose(start, points[0, stance.point, :2], atol=1e-12)


def test_jacobian() -> None:
    motion = clip(skating(10, 0.3))
    for residual in residuals_of(TERM, context_of(toy(), motion, schedule=rolling_foot()))[0]:
        assert isinstance(residual, FrameResidual)
        assert jacobian_error(residual, 0.3 * np.random.default_rng(1).normal(size=200)) < 1e-8


def test_a_skating_foot_ends_up_still() -> None:
    """Both feet slide 0.2 m while the schedule has them standing; every point ends within a millimetre of one spot."""
    robot, motion = toy(), clip(skating(50, 0.2))
    problem = problem_of(
        ("cost", Tracking(position=0.03, orientation=0.2, robust=0.05)),
        ("cost", Acceleration(base_position=5.0, base_rotation=20.0, joints=40.0)),
        ("cost", StanceAnchor(horizontal=0.001, vertical=0.001)),
    )
    task = Task(motion, motion, np.ones(50), both_feet(50), np.zeros(0, int))
    result, report = solve_clip(task, kinematics_of(robot), problem)
    assert report.status == "converged"
    before, after = (sole_points(m, robot) for m in (motion, result))
    assert np.ptp(before[..., 0], axis=0).max() > 0.19
    assert np.ptp(after, axis=0).max() < 0.001
    assert np.abs(after[..., 2]).max() < 0.001
    # The spot is the middle of the slide: the anchor is free, and tracking puts it there.
    assert after[0, 0, 0] == pytest.approx(before[:, 0, 0].mean(), abs=0.01)


def test_each_stance_has_its_own_spot() -> None:
    """A foot that stands, moves on and stands again is held twice, not dragged to one anchor for both."""
    robot = toy()
    qpos = standing(60)
    qpos[:, 0] = 0.3 * np.clip((np.arange(60) - 25) / 10, 0, 1)
    stances = tuple(
        sorted(
            Stance(side, k, part, start, stop)
            for side in ("left", "right")
            for k, part in enumerate(("toe", "toe", "heel", "heel"))
            for start, stop in ((0, 25), (36, 60))
        )
    )
    motion = clip(qpos)
    task = Task(motion, motion, np.ones(60), ContactSchedule(60, FPS, stances), np.zeros(0, int))
    problem = problem_of(
        ("cost", Tracking(position=0.03, orientation=0.2, robust=0.05)),
        ("cost", StanceAnchor(horizontal=0.001, vertical=0.001)),
    )
    result, _ = solve_clip(task, kinematics_of(robot), problem)
    np.testing.assert_allclose(result.qpos[:25, 0], 0.0, atol=1e-3)
    np.testing.assert_allclose(result.qpos[36:, 0], 0.3, atol=1e-3)


def test_a_foot_on_its_toes_turns_about_its_tip() -> None:
    robot, schedule = toy(), rolling_foot()
    term = StanceAnchor(horizontal=0.001, vertical=0.002, rise=0.006)
    (residual,), variables = residuals_of(term, context_of(robot, clip(standing(10)), schedule=schedule))
    assert isinstance(residual, FrameResidual)
    assert list(pivots(robot.soles[0])) == ["toe"]  # nothing of the outline is behind the heel
    assert list(residual.rows)[-3:] == ["toe tip x", "toe tip y", "toe tip z"]
    # Of two runs of the toe one has frames of the whole toe alone, and gives the tip an anchor.  In the other a single
    # point is down: the foot may turn about it.
    assert variables.size == 9 * 10 + 2 * len(schedule.stances) + 2
    alone = np.isin(residual.frames, [6, 7])
    heights = [3 * k + 2 for k in TOE]
    assert (residual.upper[heights][:, alone] == 0.006).all() and not residual.upper[heights][
        :, residual.frames < 6
    ].any()
    np.testing.assert_array_equal(residual.weights[-1] > 0, residual.frames < 9)
    x = variables.initial()
    assert not values(residual, x)[-1].any()
    assert jacobian_error(residual, x) < 1e-6


def test_without_an_outline_there_is_no_tip() -> None:
    sole = toy().soles[0]
    assert pivots(replace(sole, outline=np.zeros((0, 3)))) == {}
    assert pivots(replace(sole, parts=("heel",) * 4)) == {}
