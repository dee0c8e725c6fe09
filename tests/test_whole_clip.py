"""One problem over all frames: repairs where rows were missing, limits that really hold, reports by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from metrics_toy import FPS, both_feet, clip, standing
from optimiser_setup import kinematics_of, problem_of, toy

from gmr_traj.attempts import Attempt
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import SolveReport
from gmr_traj.problem import Problem, load_problem
from gmr_traj.task import Task
from gmr_traj.terms.ground import Ground
from gmr_traj.terms.limits import JointAcceleration, JointPosition, JointVelocity
from gmr_traj.terms.posture import Posture
from gmr_traj.terms.self_collision import SelfCollision
from gmr_traj.terms.smoothness import Acceleration
from gmr_traj.terms.tracking import Tracking
from gmr_traj.whole_clip import solve_clip

TRACKING = ("cost", Tracking(position=0.03, orientation=0.2, robust=0.05))
POSTURE = ("cost", Posture(joints=0.5))


def solved(motion: RobotMotion, problem: Problem, target: RobotMotion | None = None) -> tuple[RobotMotion, SolveReport]:
    schedule = ContactSchedule(motion.frames, motion.fps, ())
    task = Task(motion, target or motion, np.ones(motion.frames), schedule, np.zeros(0, int))
    return solve_clip(task, kinematics_of(toy()), problem)


def with_joint(column: int, values: np.ndarray) -> RobotMotion:
    qpos = standing(len(values))
    qpos[:, 7 + column] = values
    return clip(qpos)


def test_rows_that_turn_out_to_be_missing_are_built() -> None:
    """The target leads into the torso, the centre is clear of it: no row at first, all of them after the repair."""
    centre, target = with_joint(2, np.zeros(80)), with_joint(2, np.where(np.arange(80) < 40, 0.0, -1.0))
    collision = SelfCollision(clearance=0.001, near=0.01, scale=0.001)
    terms = (TRACKING, POSTURE, ("cost", Acceleration(5.0, 20.0, 40.0)), ("hard", collision))
    through, report = solved(centre, problem_of(*terms, passes=1), target)
    assert (report.passes, report.repairs, report.repair_iterations, report.status) == (1, 0, 0, "converged")
    assert "rows that were not part of the problem are violated, first self_collision/torso:arm" in report.message
    assert through.qpos[-1, 9] < -0.95
    clear, report = solved(centre, problem_of(*terms, passes=8), target)
    assert report.passes > 1 and report.status == "converged" and report.message == ""
    assert report.repairs >= report.passes - 1 and report.repair_iterations >= report.repairs
    term = next(t for t in report.terms if t.name == "self_collision/torso:arm")
    assert term.violation < 2e-4 and term.rows > 35
    assert through.qpos[-1, 9] < clear.qpos[-1, 9] < -0.5
    # Where nothing was violated, nothing was solved again.
    np.testing.assert_array_equal(clear.qpos[:5], through.qpos[:5])


def test_a_repair_leaves_no_kink_where_it_begins() -> None:
    """Frames held at the ends of a repair carry velocity and acceleration across."""
    sway = 0.3 * np.sin(2 * np.arange(200) / FPS)
    centre, target = with_joint(2, sway), with_joint(2, sway - 1.0 * np.exp(-(((np.arange(200) - 100) / 8) ** 2)))
    collision = SelfCollision(clearance=0.001, near=0.01, scale=0.001)
    terms = (TRACKING, POSTURE, ("cost", Acceleration(5.0, 20.0, 40.0)), ("hard", collision))
    before, _ = solved(centre, problem_of(*terms, passes=1), target)
    after, report = solved(centre, problem_of(*terms, passes=8), target)
    assert 1 < report.passes and report.status == "converged" and report.message == ""
    change = (after.qpos - before.qpos)[:, 7:]
    changed = np.flatnonzero(np.abs(change).max(axis=1) > 1e-9)
    assert 40 < changed[0] < 90 and 110 < changed[-1] < 160  # half a second around what was violated
    kink = np.abs(np.diff(change, 2, axis=0)).max(axis=1)
    for edge in (changed[0], changed[-1]):
        assert kink[edge - 3 : edge + 2].max() < 0.02 * kink.max()


@pytest.mark.parametrize("near", [0.4, 0.95])
def test_limits_really_hold(near: float) -> None:
    """A square wave far beyond every limit: inside all of them, also where rows were only built in a repair."""
    robot = replace(toy(), velocity_limit=np.full(3, 4.0), acceleration_limit=np.full(3, 80.0))
    wave = 1.9 * np.sign(np.sin(4 * np.arange(60) / FPS))
    motion = with_joint(2, wave)
    problem = problem_of(
        POSTURE,
        ("cost", Tracking(position=0.1, orientation=1.0, robust=0.5)),
        ("hard", JointPosition(margin=0.01)),
        ("hard", JointVelocity(factor=0.9, near=near)),
        ("hard", JointAcceleration(factor=0.9, near=near)),
        passes=20,
    )
    task = Task(motion, motion, np.ones(60), ContactSchedule(60, FPS, ()), np.zeros(0, int))
    result, report = solve_clip(task, kinematics_of(robot), problem)
    joints = result.qpos[:, 7:]
    assert report.status == "converged" and report.message == "" and report.passes > 1
    assert (np.abs(joints) <= [2.0, 2.0, 1.5 - 0.01 + 1e-6]).all()
    assert np.abs(np.diff(joints, axis=0)).max() * FPS <= 0.9 * 4.0 + 1e-3
    assert np.abs(np.diff(joints, 2, axis=0)).max() * FPS**2 <= 0.9 * 80.0 + 1e-1
    # And they are used: the wave is followed as fast as they allow.
    assert np.abs(np.diff(joints[:, 2])).max() * FPS > 0.9 * 0.9 * 4.0


def test_what_cannot_be_is_not_called_converged() -> None:
    """Half a metre between an arm and the body it hangs from: the report says so and names Ipopt's word."""
    robot = toy()
    motion = clip(standing(6))
    impossible = problem_of(
        TRACKING, ("hard", SelfCollision(clearance=0.5, near=9.0, scale=1.0)), ("hard", JointPosition(margin=0.01))
    )
    task = Task(motion, motion, np.ones(6), ContactSchedule(6, FPS, ()), np.zeros(0, int))
    _, report = solve_clip(task, kinematics_of(robot), impossible)
    assert report.status == "not converged" and report.solver_status != "Solve_Succeeded"
    assert report.message.startswith(f"the solver stopped with {report.solver_status} after")


def test_the_report_names_every_term_with_its_worst_row() -> None:
    motion = with_joint(2, np.where(np.arange(40) == 17, 0.6, 0.0))
    _, report = solved(motion, problem_of(TRACKING, POSTURE, ("hard", Ground(0.0, 0.06, 0.001))))
    terms = {term.name: term for term in report.terms}
    assert list(terms) == ["tracking", "posture", "ground/left sole", "ground/right sole"]
    assert (terms["posture"].use, terms["posture"].unit, terms["posture"].rows) == ("cost", "rad", 120)
    assert (terms["ground/left sole"].use, terms["ground/left sole"].rows) == ("hard", 40)
    assert terms["ground/left sole"].violation < 1e-6 and terms["ground/left sole"].value == 0.0
    assert report.objective == pytest.approx(terms["tracking"].value + terms["posture"].value)
    content = report.to_json()
    assert content["terms"][1]["name"] == "posture" and not {"seconds", "evaluation_seconds", "linear_seconds"} & set(
        content
    )


def test_the_value_of_a_term_is_what_its_formula_gives() -> None:
    """With posture alone, held frames keep their deviation and all others lose theirs."""
    target, centre = with_joint(2, np.full(10, 0.3)), with_joint(2, np.zeros(10))
    held = np.arange(4)
    task = Task(centre, target, np.ones(10), ContactSchedule(10, FPS, ()), held)
    motion, report = solve_clip(task, kinematics_of(toy()), problem_of(POSTURE))
    np.testing.assert_allclose(motion.qpos[:, 9], np.where(np.arange(10) < 4, 0.0, 0.3), atol=1e-6)
    (term,) = report.terms
    assert term.value == pytest.approx(0.5 * 4 * (0.3 / 0.5) ** 2 / FPS, rel=1e-6)
    assert term.violation == pytest.approx(0.3) and term.where.startswith("shoulder, frame ")


def test_every_strategy_is_tried_and_named() -> None:
    hopeless, good = Attempt("hopeless", {"max_iter": 0}), Attempt("good", {"max_iter": 100})
    problem = replace(problem_of(TRACKING, POSTURE), first=(hopeless, good))
    _, report = solved(with_joint(2, np.zeros(6)), problem, with_joint(2, np.full(6, 0.5)))
    assert (report.status, report.strategy) == ("converged", "good")


def test_progress_is_told() -> None:
    seen: list[tuple[str, int, int]] = []
    motion = clip(standing(6))
    task = Task(motion, motion, np.ones(6), both_feet(6), np.zeros(0, int))
    problem = load_problem()
    solve_clip(task, kinematics_of(toy()), problem, lambda *step: seen.append(step))
    assert seen[0] == ("solving", 0, problem.passes)
