"""`gmr-traj bench`: every figure is there, side by side, and what cannot be measured is said in one line."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image
from test_bench import RUN

from gmr_traj import machine_code
from gmr_traj.bench.gmr_loop import MINK_IS_MISSING
from gmr_traj.cli import bench
from gmr_traj.cli.bench_work import FirstUse, Measured
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.exceptions import BenchError

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
PUNCH, KICK = EXAMPLES / "punch.npz", EXAMPLES / "kick.txt"


@pytest.fixture(autouse=True)
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is compiled first, but where a test is about that."""
    monkeypatch.setattr(bench, "compiler", lambda: None)


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch) -> list[Measured]:
    """What is measured, in that order; nothing is, in truth."""
    asked: list[Measured] = []

    def pretend(job: Measured):
        asked.append(job)
        return replace(RUN, frames=job.frames or 46)

    monkeypatch.setattr(bench, "measured", pretend)
    return asked


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    error = capsys.readouterr().err
    assert error.startswith("gmr-traj: error: ") and error.count("\n") == 1
    return error


SPLIT = "milliseconds_per_frame_and_iteration"


def check(one):
    assert one["frames_per_second"] == pytest.approx(one["frames"] / one["seconds"])
    assert one["frames_per_second"] * one["milliseconds_per_frame"] == pytest.approx(1000.0)
    assert one[SPLIT]["seconds"] * one["iterations"] == pytest.approx(one["milliseconds_per_frame"])
    assert one["startup_seconds"] >= one["loading_seconds"] > 0.1 and 50.0 < one["peak_megabytes"] < 2000.0
    if one["status"] == "done":
        assert one["linear_seconds"] is None
        return
    assert one["status"] in ("converged", "acceptable")
    assert one[SPLIT]["evaluation"] > 0 and one[SPLIT]["linear"] > 0
    assert one[SPLIT]["evaluation"] + one[SPLIT]["linear"] < one[SPLIT]["seconds"]


def test_a_human_motion_beside_the_loop(capsys, tmp_path):
    """Without a clip, that is the one that ships."""
    file, plot = tmp_path / "bench.json", tmp_path / "bench.png"
    command = ["bench", "--repeats", "1", "--measure", "gmr-loop", "retarget", "end-to-end"]
    assert main([*command, "--json", str(file), "--plot", str(plot)]) == ExitCode.OK
    content = json.loads(file.read_text())
    assert content["clip"].endswith("kick.txt") and content["frames"] == 46 and content["skipped"] == {}
    found = {one["name"]: one for one in content["measurements"]}
    assert {name: one["frames"] for name, one in found.items()} == {"gmr-loop": 46, "retarget": 46, "end-to-end": 46}
    assert [one["status"] == "done" for one in found.values()] == [True, True, False]
    for one in found.values():
        check(one)
    assert content["machine"]["cores"] >= 1 and {"casadi", "mink"} <= set(content["versions"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "kick.txt, 46 frames at 30 Hz, once"
    assert [line.split()[0] for line in lines[2:5]] == ["gmr-loop", "retarget", "end-to-end"]
    ratio = found["end-to-end"]["frames_per_second"] / found["gmr-loop"]["frames_per_second"]
    cpu = found["gmr-loop"]["cpu_seconds"] / found["end-to-end"]["cpu_seconds"]
    assert lines[5] == f"end to end: {ratio:.2f} times the frames/s of gmr-loop (by processor time: {cpu:.2f})"
    assert Image.open(plot).format == "PNG"


def test_a_robot_s_clip_is_refined_at_other_lengths_by_both_engines(capsys):
    command = ["bench", str(PUNCH), "--repeats", "1", "--seconds", "0.5", "--measure", "retarget", "--json", "-"]
    assert main(command) == ExitCode.OK
    content = json.loads(capsys.readouterr().out)
    assert content["measurements"] == [] and "takes a human motion" in content["skipped"]["retarget"]
    assert [(one["name"], one["frames"]) for one in content["growth"]] == [("refine band", 15), ("refine ipopt", 15)]
    for one in content["growth"]:
        check(one)


def test_growth_is_measured_in_turns(capsys, jobs):
    assert main(["bench", str(PUNCH), "--growth", "--repeats", "2", "--measure", "refine"]) == ExitCode.OK
    once = [(None, "band"), (None, "ipopt")]
    once += [(frames, engine) for frames in (150, 600, 2400, 7800) for engine in ("band", "ipopt")]
    assert [(job.frames, job.engine) for job in jobs] == 2 * once
    lines = capsys.readouterr().out.splitlines()
    relative = [line.split()[-1] for line in lines if line.startswith("refine band   ")]
    assert relative == ["converged", "1.00", "0.25", "0.06", "0.02"]


def test_the_compiler_is_done_before_a_person_is_measured(capsys, monkeypatch):
    asked: list[object] = []

    def pretend(job):
        asked.append(job)
        return RUN

    monkeypatch.setattr(bench, "measured", pretend)
    monkeypatch.setattr(bench, "compiler", lambda: "cc")
    monkeypatch.setattr(machine_code, "wait", lambda: asked.append("wait"))
    assert main(["bench", "--measure", "retarget", "--repeats", "2", "--quiet"]) == 0
    assert [type(job) for job in asked] == [FirstUse, str, Measured, Measured]
    assert asked[0].prepare().action().frames == 1
    asked.clear()
    assert main(["bench", str(PUNCH), "--repeats", "1", "--engines", "band", "--quiet"]) == 0
    assert [type(job) for job in asked] == [Measured]


def test_a_busy_machine_is_mentioned(capsys, monkeypatch):
    command = ["bench", str(PUNCH), "--measure", "refine", "--repeats", "1"]
    for cpu_seconds, busy in ((0.97, False), (0.52, True)):
        monkeypatch.setattr(bench, "measured", lambda job, cpu=cpu_seconds: replace(RUN, cpu_seconds=cpu))
        assert main(command) == ExitCode.OK
        assert ("had a processor for 52% of its time" in capsys.readouterr().out) is busy


def test_without_mink_the_others_are_measured(capsys, jobs, monkeypatch):
    monkeypatch.setattr(bench, "has_mink", lambda: False)
    assert main(["bench", "--repeats", "1"]) == ExitCode.OK
    assert [job.name for job in jobs] == ["retarget", "refine band", "refine ipopt", "end-to-end"]
    assert f"not measured: gmr-loop: {MINK_IS_MISSING}\n" in capsys.readouterr().out
    assert main(["bench", "--measure", "gmr-loop"]) == ExitCode.BAD_INPUT
    assert "pip install 'gmr-traj[bench]'" in one_line(capsys)


def test_a_process_that_ends_early_costs_its_own_figures_alone(capsys, jobs, monkeypatch):
    pretend = bench.measured

    def kills_ipopt(job: Measured):
        if job.engine == "ipopt":
            raise BenchError("the process that measures was killed by SIGKILL")
        return pretend(job)

    monkeypatch.setattr(bench, "measured", kills_ipopt)
    assert main(["bench", "--repeats", "2"]) == ExitCode.BAD_INPUT
    assert len(jobs) == 2 * 4
    output = capsys.readouterr()
    assert "not measured: refine ipopt: the process that measures was killed" in output.out
    assert output.err.count("\n") == 1 and "refine ipopt" in output.err


def test_not_converged_has_its_exit_code(jobs, monkeypatch):
    monkeypatch.setattr(bench, "measured", lambda job: replace(RUN, status="not converged"))
    assert main(["bench", str(PUNCH), "--measure", "refine", "--quiet"]) == ExitCode.NOT_CONVERGED


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["absent.npz"], "absent.npz"),
        ([str(PUNCH), "--seconds", "-1"], "lengths must be at least 4 frames"),
        ([str(PUNCH), "--repeats", "0"], "--repeats 0: give 1 or more"),
        ([str(PUNCH), "--height", "1.7"], "--height is about a human motion"),
        ([str(KICK), "--quaternion", "xyzw"], "--quaternion is about a robot's clip"),
        ([str(PUNCH), "--measure", "end-to-end"], "nothing to measure: end-to-end: punch.npz is a robot's clip"),
        ([str(PUNCH), "--plot", "bench.svg"], "name it bench.png"),
        ([str(PUNCH), "--json", str(PUNCH)], "name another file with --json"),
        ([str(PUNCH), "--plot", "absent/bench.png"], "there is no folder absent"),
    ],
)
def test_bad_input_is_one_line(capsys, jobs, argv, text):
    assert main(["bench", *argv]) == ExitCode.BAD_INPUT
    assert text in one_line(capsys) and jobs == []


def test_files_are_overwritten_only_where_that_is_said(capsys, jobs, tmp_path):
    file = tmp_path / "bench.json"
    file.write_text("mine")
    command = ["bench", str(PUNCH), "--measure", "refine", "--repeats", "1", "--json", str(file)]
    assert main(command) == ExitCode.BAD_INPUT
    assert "--json, or overwrite it with --force" in one_line(capsys) and file.read_text() == "mine"
    assert main([*command, "--force"]) == ExitCode.OK
    assert json.loads(file.read_text())["repeats"] == 1


def test_an_engine_that_the_problem_has_not(capsys, jobs, tmp_path):
    problem = tmp_path / "problem.toml"
    text = (EXAMPLES.parent / "problems" / "refine.toml").read_text()
    problem.write_text(text.replace('engine = "band"\n', ""))
    assert main(["bench", str(PUNCH), "--problem", str(problem), "--engines", "band"]) == ExitCode.BAD_INPUT
    assert "no [[solver.first]] has engine 'band'; they have ipopt" in one_line(capsys)
