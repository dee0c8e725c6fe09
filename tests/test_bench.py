"""Measurements: medians and what follows from them, processes of their own, lengths, engines, and the picture."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from bench_jobs import Fails, Sleeps
from PIL import Image
from retarget_setup import dance

from gmr_traj.bench import gmr_loop
from gmr_traj.bench.chart import chart
from gmr_traj.bench.engine import engines, with_engine
from gmr_traj.bench.figures import Figures, Run, gathered
from gmr_traj.bench.fresh import measured
from gmr_traj.bench.lengths import clip_of_length, forth_and_back, human_of_length
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.exceptions import BenchError, GmrTrajError
from gmr_traj.formats.clip import Clip
from gmr_traj.human_motion import HumanMotion
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem
from gmr_traj.references import BodyTargets
from gmr_traj.retarget.body_map import load_map
from gmr_traj.robot import Robot

RUN = Run(
    frames=100,
    iterations=4,
    status="converged",
    evaluation_seconds=0.2,
    linear_seconds=0.4,
    seconds=1.0,
    cpu_seconds=0.9,
    first_seconds=1.5,
    first_cpu_seconds=1.2,
    loading_seconds=0.7,
    loading_cpu_seconds=0.6,
    peak_megabytes=200.0,
)


def figures(name: str, frames: int, seconds: float) -> Figures:
    return Figures(name, (replace(RUN, frames=frames, seconds=seconds),))


def test_medians_and_what_follows_from_them():
    slow, fast = replace(RUN, seconds=4.0, status="acceptable"), replace(RUN, seconds=0.5, linear_seconds=0.1)
    found = Figures("refine band", (slow, RUN, fast))
    assert found.frames_per_second == pytest.approx(100.0) and found.milliseconds_per_frame == pytest.approx(10.0)
    assert found.milliseconds("seconds") == pytest.approx(2.5)
    assert found.milliseconds("evaluation_seconds") == pytest.approx(0.5)
    assert found.milliseconds("linear_seconds") == pytest.approx(1.0)
    assert found.status == "acceptable"  # the worst of all
    assert RUN.startup_seconds == pytest.approx(1.2) and RUN.startup_cpu_seconds == pytest.approx(0.9)
    assert slow.startup_seconds == pytest.approx(0.7)  # never less than loading
    content = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert content["seconds"] == 1.0 and len(content["runs"]) == 3 and content["startup_seconds"] == pytest.approx(1.2)


def test_what_nobody_counts_is_not_there():
    found = Figures("retarget", (replace(RUN, evaluation_seconds=None, linear_seconds=None),))
    assert found.milliseconds("linear_seconds") is None
    content = found.to_json()
    assert content["evaluation_seconds"] is None
    assert content["milliseconds_per_frame_and_iteration"] == {"seconds": 2.5, "evaluation": None, "linear": None}


def test_no_iterations_are_no_division_by_zero():
    assert Figures("refine", (replace(RUN, iterations=0),)).milliseconds("seconds") == pytest.approx(10.0)


def test_runs_of_a_name_and_a_length_belong_together():
    found = gathered([("b", None, RUN), ("a", 10, RUN), ("b", None, RUN), ("a", 20, RUN)])
    assert [(one.name, len(one.runs)) for one in found] == [("b", 2), ("a", 1), ("a", 1)]


def test_a_job_is_done_twice_in_a_process_of_its_own():
    run = measured(Sleeps())
    assert run.frames == 20 and run.status == "converged"  # the second time's
    assert run.seconds >= 0.1 and run.first_seconds >= 0.3 and run.cpu_seconds < 0.1
    assert 0.0 < run.loading_cpu_seconds <= run.loading_seconds
    assert run.peak_megabytes < 100.0  # though this process has more


def test_peak_memory_is_that_of_the_first_time():
    more, less = (measured(Sleeps(megabytes)).peak_megabytes for megabytes in (150, 0))
    assert more - less == pytest.approx(150.0, abs=20.0)


def test_why_there_is_no_answer():
    with pytest.raises(GmrTrajError, match=r"^walk\.bvh: no such file$"):
        measured(Fails("refused"))
    with pytest.raises(BenchError, match="killed by SIGKILL; it may have needed more memory"):
        measured(Fails("killed"))
    with pytest.raises(BenchError, match="exit code 1: ValueError: a fault"):
        measured(Fails("fault"))


def ramp(frames: int) -> RobotMotion:
    qpos = np.zeros((frames, 8))
    qpos[:, 3] = 1.0
    qpos[:, 7] = np.arange(frames)
    return RobotMotion(qpos, 10.0, ("joint",))


def test_a_longer_clip_goes_forth_and_back():
    np.testing.assert_array_equal(forth_and_back(4, 10), [0, 1, 2, 3, 2, 1, 0, 1, 2, 3])
    np.testing.assert_array_equal(forth_and_back(40, 5), np.arange(5))
    np.testing.assert_array_equal(forth_and_back(1, 3), [0, 0, 0])


def test_targets_go_with_the_clip_and_a_schedule_only_with_its_own_length():
    motion = ramp(4)
    at = np.zeros((4, 1, 3))
    at[:, 0, 0] = np.arange(4)
    targets = BodyTargets(("body",), at, np.tile([1.0, 0, 0, 0], (4, 1, 1)), np.ones(1), np.ones(1))
    whole = Clip(motion, "gmr-traj", schedule=ContactSchedule(4, 10.0, ()), references=targets)
    assert clip_of_length(whole, 4) is whole
    longer = clip_of_length(whole, 6)
    np.testing.assert_array_equal(longer.motion.qpos[:, 7], [0, 1, 2, 3, 2, 1])
    assert longer.schedule is None and longer.references is not None
    np.testing.assert_array_equal(longer.references.positions[:, 0, 0], [0, 1, 2, 3, 2, 1])


def test_a_person_goes_forth_and_back_with_the_feet_where_they_were():
    at = np.zeros((3, 2, 3))
    at[:, 1, 2] = [1.0, 2.0, 3.0]
    still = np.tile([1.0, 0, 0, 0], (3, 2, 1))
    touching = {"foot": np.array([True, False, False])}
    human = HumanMotion("mine", ("hip", "foot"), (-1, 0), at, still, 30.0, 1.7, touching)
    longer = human_of_length(human, 5)
    np.testing.assert_array_equal(longer.positions[:, 1, 2], [1, 2, 3, 2, 1])
    np.testing.assert_array_equal(longer.contacts["foot"], [True, False, False, False, True])


def test_a_problem_with_one_engine():
    problem = load_problem("refine")
    assert engines(problem) == ("band", "ipopt")
    for engine in engines(problem):
        alone = with_engine(problem, engine)
        assert {attempt.engine for attempt in (*alone.first, *alone.again)} == {engine}
        assert alone.terms == problem.terms and alone.passes == problem.passes
    band = with_engine(problem, "band")
    assert engines(band) == ("band",)
    with pytest.raises(BenchError, match=r"no \[\[solver.first\]\] has engine 'ipopt'; they have band"):
        with_engine(band, "ipopt")


def test_without_mink_the_loop_says_what_to_install(g1: Robot, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(gmr_loop, "find_spec", lambda name: None)
    qpos = dance(g1, 2)
    targets = BodyTargets(("pelvis",), qpos[:, None, :3], qpos[:, None, 3:7], np.ones(1), np.ones(1))
    with pytest.raises(BenchError, match=r"pip install 'gmr-traj\[bench\]'"):
        gmr_loop.gmr_loop(g1, load_map("lafan1_to_unitree_g1", g1), targets)


def test_the_picture_has_a_bar_a_measurement_as_long_as_it_is_fast():
    sides = [figures("gmr-loop", 100, 2.0), figures("refine band", 100, 1.0)]
    picture = np.asarray(Image.open(io.BytesIO(chart("kick.txt", sides, []))).convert("RGB"))
    assert picture.shape[1] == 1000
    long = [(picture == colour).all(axis=2).sum(axis=1).max() for colour in ((230, 108, 55), (38, 148, 214))]
    assert long[1] == pytest.approx(2 * long[0], rel=0.01)


def test_the_picture_of_growth_is_drawn_for_one_length_and_for_many():
    for lengths in ((150,), (150, 600, 2400)):
        growth = [figures("refine band", frames, frames / 200) for frames in lengths]
        assert Image.open(io.BytesIO(chart("kick.txt", [], growth))).format == "PNG"
