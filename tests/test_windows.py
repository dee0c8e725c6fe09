"""Windows: held frames, seams that cannot be seen, agreement with the whole clip, lengths that cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from metrics_toy import FPS, both_feet, clip, standing
from optimiser_setup import kinematics_of, toy
from scipy.spatial.transform import Rotation

from gmr_traj import windows
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.exceptions import ProblemError
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import SolveReport
from gmr_traj.problem import load_problem
from gmr_traj.refine import Refinement, refine
from gmr_traj.task import HELD, Task
from gmr_traj.visited import Visited
from gmr_traj.whole_clip import solve_clip
from gmr_traj.windows import solve_windows

# Physics ties a frame to what comes after the window: two windows agree less there than they do here.
PROBLEM = load_problem("refine_kinematic")


def noisy(frames: int = 150, jump: float = 0.0, noise: float = 1.0) -> RobotMotion:
    """A toy that sways on its feet with an arm in the air, noise on everything, and a jump of the arm half way."""
    rng, t = np.random.default_rng(0), np.arange(frames) / FPS
    qpos = standing(frames)
    qpos[:, 0] = 0.1 * np.sin(2 * t)
    qpos[:, 7], qpos[:, 8] = 0.3 * np.sin(3 * t), -0.3 * np.sin(3 * t)
    qpos[:, 9] = 0.8 * np.sin(2 * t)
    qpos[:, 7:] += 0.01 * noise * rng.normal(size=(frames, 3))
    qpos[:, :3] += 0.003 * noise * rng.normal(size=(frames, 3))
    qpos[frames // 2 :, 9] += jump
    return clip(qpos)


def refined(motion: RobotMotion, window: float | None = None, overlap: float | None = None) -> Refinement:
    robot = toy()
    return refine(motion, robot, PROBLEM, window=window, overlap=overlap, kinematics=kinematics_of(robot))


def jerk(motion: RobotMotion) -> np.ndarray:
    """Largest joint jerk of each frame [rad/s^3]."""
    return np.asarray(np.abs(np.diff(motion.qpos[:, 7:], 3, axis=0)).max(axis=1) * motion.fps**3)


@pytest.fixture(scope="module")
def whole() -> Refinement:
    return refined(noisy())


@pytest.mark.parametrize(("window", "overlap"), [(1.0, None), (1.0, 0.5), (2.0, 0.5)])
def test_windows_come_to_what_the_whole_clip_comes_to(whole: Refinement, window: float, overlap: float | None) -> None:
    result = refined(noisy(), window, overlap)
    assert "not converged" not in (result.report.status, whole.report.status)
    assert result.schedule == whole.schedule
    change = np.abs(noisy().qpos - whole.motion.qpos)
    difference = np.abs(result.motion.qpos - whole.motion.qpos)
    assert np.sqrt((difference**2).mean()) < 0.1 * np.sqrt((change**2).mean())
    assert difference[:, :3].max() < 0.003 and difference[:, 7:].max() < 0.06
    # No seam: jerk is nowhere larger than in the whole clip, and the seams have no other jerk than the rest.
    seamless, seamed = jerk(whole.motion), jerk(result.motion)
    assert seamed.max() < 1.1 * seamless.max()
    assert np.median(seamed) < 1.2 * np.median(seamless)
    length, ahead = round(window * FPS), round((window / 4 if overlap is None else overlap) * FPS)
    seams = np.arange(length - ahead, 140, length - ahead - HELD)
    at = np.unique(np.clip(seams[:, None] + np.arange(-4, 3), 0, len(seamed) - 1))
    assert seams.size and np.median(seamed[at]) < 2 * np.median(seamless[at])


def test_one_window_is_the_whole_clip(whole: Refinement) -> None:
    assert refined(noisy(), 10.0).motion.qpos.tobytes() == whole.motion.qpos.tobytes()
    assert refined(noisy(), 3.0, 0.0).motion.qpos.tobytes() == whole.motion.qpos.tobytes()


@pytest.mark.parametrize(("window", "overlap"), [(0.5, None), (1.0, 0.5)])
def test_a_jump_over_a_seam_does_not_spin_the_base(window: float, overlap: float | None) -> None:
    """Large steps at a fault must not wind the base around: a full turn looks right in a frame and is none."""
    motion = noisy(jump=0.5)
    result = refined(motion, window, overlap)
    assert result.report.status != "not converged"
    before, after = (Rotation.from_quat(m.qpos[:, 3:7], scalar_first=True) for m in (motion, result.motion))
    assert np.degrees((after * before.inv()).magnitude()).max() < 5.0
    assert np.degrees((after[1:] * after[:-1].inv()).magnitude()).max() < 3.0


def test_held_frames_do_not_move() -> None:
    motion = noisy(40)
    held = np.array([0, 1, 2, 20, 39])
    task = Task(motion, motion, np.ones(40), both_feet(40), held)
    result, report = solve_clip(task, kinematics_of(toy()), PROBLEM)
    assert report.status != "not converged"
    np.testing.assert_allclose(result.qpos[held], motion.qpos[held], atol=1e-12)
    assert np.abs(result.qpos - motion.qpos).max() > 1e-3


@pytest.mark.parametrize("window", [None, 1.0])
def test_ends_that_are_asked_to_stay_are_where_the_input_has_them(window: float | None) -> None:
    motion, robot = noisy(80), toy()
    held = np.array([0, 1, 2, 77, 78, 79])
    result = refine(motion, robot, PROBLEM, held=held, window=window, kinematics=kinematics_of(robot))
    np.testing.assert_allclose(result.motion.qpos[held], result.levelled.qpos[held], atol=1e-12)
    assert np.abs(result.motion.qpos - result.levelled.qpos)[3:77].max(axis=1).min() > 1e-6


def test_limits_hold_across_seams_where_held_frames_are_at_the_limit() -> None:
    """A joint that rests on its limit is held there to a rounding error, on either side."""
    qpos = standing(100)
    qpos[:, 9] = 1.7 * np.sin(3 * np.arange(100) / FPS)
    result = refined(clip(qpos), 0.5, 0.1)
    assert result.report.status == "converged"
    assert qpos[:, 9].max() > toy().position_upper[2] >= result.motion.qpos[:, 9].max() > 1.49


def test_a_stance_over_a_seam_keeps_its_spot() -> None:
    """The anchor of the next window is tied to the frames that are held: feet do not creep from window to window."""
    robot, motion = toy(), noisy(150, noise=0.2)
    still = motion.with_qpos(np.where(np.isin(np.arange(10), [7, 8]), 0.0, motion.qpos))
    task = Task(still, still, np.ones(150), both_feet(150), np.zeros(0, int))
    result, report = solve_windows(task, kinematics_of(robot), PROBLEM, 0.8, 0.2)
    assert report.status != "not converged"
    assert np.ptp(result.qpos[:, 0]) < 0.02 < 0.1 < np.ptp(still.qpos[:, 0])


def test_parts_of_a_task_count_from_their_own_start() -> None:
    motion, other = noisy(30), noisy(30, jump=1.0)
    stances = (Stance("left", 0, "toe", 0, 8), Stance("left", 1, "toe", 5, 25), Stance("right", 0, "toe", 22, 30))
    schedule = ContactSchedule(30, FPS, stances, height=0.02)
    task = Task(motion, motion, np.linspace(0.1, 1, 30), schedule, np.zeros(0, int), visited=(Visited(toy(), other),))
    part = task.part(other, 10, 24, held=np.arange(3))
    assert part.schedule == ContactSchedule(
        14, FPS, (Stance("left", 1, "toe", 0, 14), Stance("right", 0, "toe", 12, 14)), height=0.02
    )
    np.testing.assert_array_equal(part.centre.qpos, other.qpos[10:24])
    np.testing.assert_array_equal(part.target.qpos, motion.qpos[10:24])
    np.testing.assert_array_equal(part.visited[0].motion.qpos, other.qpos[10:24])
    np.testing.assert_array_equal(part.trust, task.trust[10:24])
    np.testing.assert_array_equal(part.held, [0, 1, 2])


def test_reports_name_frames_of_the_clip_and_add_up() -> None:
    motion = noisy(120)
    qpos = motion.qpos.copy()
    qpos[90, 9] += 0.4  # the worst of the posture's rows
    result = refined(motion.with_qpos(qpos), 1.0, 0.2)
    terms = {term.name: term for term in result.report.terms}
    assert terms["posture"].where == "shoulder, frame 90"
    assert len(terms) == len(result.report.terms)
    assert result.report.objective == pytest.approx(sum(term.value for term in result.report.terms))
    assert terms["posture"].rows >= 120 * 3


def test_a_window_starts_from_what_the_last_one_saw_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    """Held frames are final, the look-ahead is where the next window begins, and every frame is kept once."""
    motion, parts = noisy(100), []

    def solve(part: Task, *_: object) -> tuple[RobotMotion, SolveReport]:
        parts.append(part)
        qpos = part.centre.qpos.copy()
        qpos[len(part.held) :, 0] = len(parts)  # the window's mark
        report = SolveReport("converged", "Solve_Succeeded", "fake", 1, 0.0, 0.0, 0.0, 1, 0.0, (), "")
        return part.centre.with_qpos(qpos), report

    monkeypatch.setattr(windows, "solve_clip", solve)
    task = Task(motion, motion, np.ones(100), both_feet(100), np.zeros(0, int))
    result, report = solve_windows(task, kinematics_of(toy()), PROBLEM, 0.8, 0.2)
    # Windows of 40 frames that keep all but 10, of which three are held in the next: 0-40, 27-67, 54-94, 81-100.
    assert [(len(part.held), part.centre.frames) for part in parts] == [(0, 40), (3, 40), (3, 40), (3, 19)]
    np.testing.assert_array_equal(result.qpos[:, 0], np.repeat([1, 2, 3, 4], [30, 27, 27, 16]))
    for number, part in enumerate(parts[1:], start=1):
        ahead = part.centre.qpos[: HELD + 10, 0]
        np.testing.assert_array_equal(ahead, np.full(HELD + 10, number))
        assert (part.centre.qpos[HELD + 10 :, 0] != number).all()
    for part, start in zip(parts, (0, 27, 54, 81), strict=True):
        np.testing.assert_array_equal(part.target.qpos, motion.qpos[start : start + part.target.frames])
    assert report.iterations == 4 and report.status == "converged"


def test_a_window_that_fails_is_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def solve(part: Task, *_: object) -> tuple[RobotMotion, SolveReport]:
        calls.append(part)
        status = "not converged" if len(calls) == 2 else "acceptable"
        return part.centre, SolveReport(status, "word", "fake", 1, 0.0, 0.0, 0.0, 1, 0.0, (), status)

    monkeypatch.setattr(windows, "solve_clip", solve)
    motion = noisy(150)
    task = Task(motion, motion, np.ones(150), both_feet(150), np.zeros(0, int))
    _, report = solve_windows(task, kinematics_of(toy()), PROBLEM, 0.8, 0.2)
    assert len(calls) == 2 and report.status == "not converged" and report.message == "acceptable; not converged"


def test_progress_counts_frames() -> None:
    seen: list[tuple[str, int, int]] = []
    robot = toy()
    refine(noisy(80), robot, PROBLEM, window=0.8, progress=lambda *step: seen.append(step))
    assert next(step for step in seen if step[0] == "windows") == ("windows", 0, 80)
    assert all(0 <= done <= total for _, done, total in seen)


@pytest.mark.parametrize(
    ("window", "overlap", "message"),
    [
        (0.1, 0.0, "a window of 0.1 s with an overlap of 0 s keeps 5 frames at 50 fps; at least 6 are needed"),
        (1.0, 0.95, "keeps 2 frames .* choose a longer window or a shorter overlap"),
        (1.0, 3.0, "keeps -100 frames"),
        (0.0, None, "the window is 0 s; expected a positive number"),
        (-1.0, None, "the window is -1 s; expected a positive number"),
        (float("nan"), None, "the window is nan s"),
        (float("inf"), None, "the window is inf s"),
        (1.0, -0.1, "the overlap is -0.1 s; expected a number of seconds, zero or more"),
        (1.0, float("nan"), "the overlap is nan s"),
        (None, 0.5, "an overlap of 0.5 s is of windows, and there are none"),
    ],
)
def test_lengths_that_cannot_be(window: float | None, overlap: float | None, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        refined(noisy(60), window, overlap)
