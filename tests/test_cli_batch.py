"""`gmr-traj batch` from folders to a folder: what is written, what a second run does, and what it says."""

import json
import shutil
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

from gmr_traj.batch import cluster
from gmr_traj.batch.summary import ranked, shortfall, totals
from gmr_traj.cli.batch import exit_code
from gmr_traj.cli.batch_arguments import Batch
from gmr_traj.cli.batch_clips import find_clips
from gmr_traj.cli.batch_recording import wanted
from gmr_traj.cli.batch_work import Steps
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.exceptions import BatchError, ClipError
from gmr_traj.formats import read_clip, write_clip

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
QUIET = {"processes": False, "dashboard_address": "127.0.0.1:0", "memory_limit": None}


@contextmanager
def in_process(jobs: int, dashboard: str | None = None):
    """A cluster in this process, which starts at once; the clips are in processes of their own all the same."""
    with LocalCluster(n_workers=1, threads_per_worker=jobs, **QUIET) as made, Client(made) as client:
        yield client


@pytest.fixture
def data(tmp_path, monkeypatch, g1):
    """Short clips in two folders, one of them broken; the working folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "local_cluster", in_process)
    punch = read_clip(EXAMPLES / "punch.npz", g1)
    for name, first, file_format in (("a/punch.npz", 0, None), ("b/punch.csv", 20, "unitree-csv")):
        motion = punch.motion.with_qpos(punch.motion.qpos[first : first + 24])
        (tmp_path / name).parent.mkdir()
        write_clip(replace(punch, motion=motion, schedule=None), tmp_path / name, format=file_format, robot=g1)
    (tmp_path / "b" / "broken.npz").write_bytes(b"PK\x03\x04 not whole")
    return tmp_path


def written(folder: Path) -> dict[str, bytes]:
    paths = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return {path.as_posix(): (folder / path).read_bytes() for path in paths if path.as_posix() != ".batch/lock"}


def record(folder: Path, name: str) -> dict:
    return json.loads((folder / f"{name}.record.json").read_text())


def test_a_batch_is_what_refine_makes_of_each_clip_and_goes_on_where_it_stopped(data, capsys):
    out = data / "out"
    assert main(["batch", "a", "b", "--out", "out", "--jobs", "1"]) == ExitCode.CLIP_FAILED
    captured = capsys.readouterr()
    first = written(out)
    assert first.keys() == {
        "punch_npz.npz",
        "punch_npz.record.json",
        "punch_csv.csv",
        "punch_csv.record.json",
        "broken.record.json",
        "summary.jsonl",
        "times.jsonl",
        "totals.json",
    }
    assert "3 clips: 0 done before, 3 to do (3 new)" in captured.err and "FAILED" in captured.out
    assert "broken.npz" in record(out, "broken")["reason"] and record(out, "broken")["status"] == "failed"

    for name, one in (("a/punch.npz", "punch_npz.npz"), ("b/punch.csv", "punch_csv.csv")):
        code = main(["refine", name, "--output", Path(one).name, "--quiet"])
        assert Path(Path(one).name).read_bytes() == first[one]
        report = json.loads(Path(f"{Path(one).name}.report.json").read_text())
        done = record(out, one.rsplit(".", 1)[0])
        assert all(done[key] == report[key] for key in ("certificate", "solver", "audit", "contacts", "notes"))
        assert code == (0 if done["certificate"]["held"] else 3)

    assert main(["batch", "a", "b", "--out", "out", "--jobs", "1"]) == ExitCode.CLIP_FAILED
    assert "3 clips: 2 done before, 1 to do (1 failed before)" in capsys.readouterr().err
    times = [json.loads(line) for line in (out / "times.jsonl").read_text().splitlines()]
    assert [entry["clip"] for entry in times[3:]] == ["broken"]
    again = written(out)
    assert {**again, "times.jsonl": b""} == {**first, "times.jsonl": b""}

    assert main(["batch", "a", "b", "--out", "out", "--no-retry-failed", "--json", "--quiet"]) == ExitCode.CLIP_FAILED
    captured = capsys.readouterr()
    report = json.loads(captured.out)
    assert captured.err == "" and report["totals"]["clips"] == 3 and report["totals"]["failed"] == 1
    assert [json.loads(line) for line in (out / "summary.jsonl").read_text().splitlines()] == report["clips"]
    assert report["clips"][0]["clip"] == "broken" and report["clips"][1]["before"]["frames"] == 24


def test_leads_are_those_of_refine_and_decide_the_result(data, capsys):
    command = ["batch", "a", "--out", "out", "--jobs", "1", "--lead-in", "0.8"]
    assert main([*command, "--rerun", "all"]) in (ExitCode.OK, ExitCode.BROKEN_PROMISE), capsys.readouterr()
    main(["refine", "a/punch.npz", "--lead-in", "0.8", "--output", "alone.npz", "--quiet"])
    report, done = json.loads(Path("alone.npz.report.json").read_text()), record(data / "out", "punch")
    assert (data / "out" / "punch.npz").read_bytes() == Path("alone.npz").read_bytes()
    assert all(done[key] == report[key] for key in ("certificate", "solver", "contacts", "notes", "lead", "physics"))
    assert done["lead"]["in"]["frames"] == 24 and done["lead"]["out"] is None and done["options"]["lead_in"] == 0.8
    assert (data / "out" / "punch.rrd").stat().st_size > 10**4
    capsys.readouterr()
    assert main(command) in (ExitCode.OK, ExitCode.BROKEN_PROMISE)
    assert "1 done before, 0 to do" in capsys.readouterr().err
    assert main([*command[:-1], "0.05"]) == ExitCode.CLIP_FAILED
    assert "1 to do (1 lead_in changed)" in capsys.readouterr().err
    assert "--lead-in 0.05 s is too short" in record(data / "out", "punch")["reason"]


@pytest.mark.slow
def test_all_steps_for_a_human_motion(data, g1, capsys):
    shutil.copy(EXAMPLES / "kick.txt", data)
    command = ["batch", "kick.txt", "--out", "out", "--steps", "verify", "refine", "retarget", "--rerun", "worst:1"]
    assert main([*command, "--fps", "20"]) in (0, ExitCode.NOT_FOLLOWED), capsys.readouterr()
    done = record(data / "out", "kick")
    assert done["options"]["steps"] == ["retarget", "refine", "verify"] and done["kind"] == "human"
    files = {what: output["file"] for what, output in done["outputs"].items()}
    assert files == {"clip": "kick.npz", "retargeted": "kick.retargeted.npz"}
    assert isinstance(done["verify"]["passed"], bool) and done["certificate"]["held"]
    main(["retarget", "kick.txt", "--fps", "20", "--output", "retargeted.npz", "--quiet"])
    assert (data / "out" / "kick.retargeted.npz").read_bytes() == Path("retargeted.npz").read_bytes()
    assert (data / "out" / "kick.rrd").stat().st_size > 10**4
    assert main([*command, "--fps", "20"]) in (0, ExitCode.NOT_FOLLOWED)
    assert "1 done before, 0 to do" in capsys.readouterr().err


def test_a_clip_has_the_schedule_that_bears_its_name(data):
    (data / "schedules").mkdir()
    schedule = data / "schedules" / "punch_npz.json"
    schedule.write_text("{}")
    clips = find_clips(Batch(inputs=("a", "b"), out=Path("out"), contacts=Path("schedules")))
    named = {name: one.path for name, one in clips.named({}).items()}
    assert clips.work("punch_npz", named["punch_npz"]).refine.contacts == schedule
    assert clips.work("punch_csv", named["punch_csv"]).refine.contacts is None
    before = clips.expected("punch_npz", named["punch_npz"])
    schedule.write_text('{"frames": 24}')
    assert clips.expected("punch_npz", named["punch_npz"]) != before


def test_what_decides_is_content_and_not_the_path(data):
    (data / "own.toml").write_bytes((EXAMPLES.parent / "problems" / "refine.toml").read_bytes())
    path = data / "a" / "punch.npz"
    shipped = find_clips(Batch(inputs=("a",), out=Path("out"))).expected("punch", path)
    assert find_clips(Batch(inputs=("a",), out=Path("out"), problem="own.toml")).expected("punch", path) == shipped
    with (data / "own.toml").open("a") as stream:
        stream.write("# changed\n")
    assert find_clips(Batch(inputs=("a",), out=Path("out"), problem="own.toml")).expected("punch", path) != shipped
    assert find_clips(Batch(inputs=("a",), out=Path("out"), window=2.0)).expected("punch", path) != shipped


@pytest.mark.parametrize(
    ("name", "step", "text"),
    [("punch.npz", "retarget", "nothing to retarget"), ("kick.txt", "verify", "retarget it first")],
)
def test_a_step_that_is_not_for_the_input_is_its_reason(tmp_path, name, step, text):
    batch = Batch(inputs=(name,), out=tmp_path, steps=(step,))
    path = EXAMPLES / name
    refine = batch.of_clip(path, name == "kick.txt", None)
    work = Steps(name="clip", refine=refine, versions={}, steps=batch.steps, verify=batch.of_verify(path))
    with pytest.raises(ClipError, match=text):
        work.carry_out(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_batch_of_both_gives_each_its_own_options(tmp_path):
    batch = Batch(inputs=("a",), out=tmp_path, height=1.8, quaternion="xyzw", window=2.0, fps=30.0)
    robot, human = batch.of_clip(Path("a"), False, None), batch.of_clip(Path("a"), True, Path("c.json"))
    assert (robot.height, robot.quaternion, robot.window, robot.fps, robot.contacts) == (None, "xyzw", 2.0, 30.0, None)
    assert (human.height, human.quaternion, human.window, human.fps) == (1.8, None, 2.0, 30.0)
    assert human.contacts == Path("c.json")


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["absent"], "absent: no such file or folder"),
        (["a", "--steps"], "--steps needs at least one"),
        (["a", "--robot", "r2d2"], "r2d2: no such file"),
        (["a", "--problem", "peace"], "peace: no such file"),
        (["a", "--height", "1.8"], "--height is about human motion"),
        (["a", "--lead-in", "0"], "--lead-in is 0; expected seconds"),
        (["a", "--steps", "verify", "--lead-out", "1"], "--lead-in and --lead-out are of the step refine"),
        (["a", "--jobs", "0"], "--jobs is at least 1"),
        (["a", "--time-limit", "0"], "the time limit is 0 s"),
        (["a", "--memory-limit", "-1"], "the memory limit is"),
        (["a", "--retries", "-1"], "retries are -1"),
        (["a", "--rerun", "best:3"], "--rerun is 'best:3'; expected worst:10"),
        (["a", "--contacts", "absent"], "--contacts absent: there is no such folder"),
        (["a", "--settings", "absent"], "absent: no such file"),
        (["a", "--out", "a"], "write the batch to another one"),
        (["a", "--steps", "verify", "--conditions", "absent"], "absent"),
        ([], "batch needs at least one"),
    ],
)
def test_bad_usage_is_one_line_and_writes_nothing(data, capsys, argv, text):
    before = written(data)
    out = [] if "--out" in argv else ["--out", "out"]
    assert main(["batch", *argv, *out]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith("gmr-traj: error: ") and error.count("\n") == 1 and text in error
    assert written(data) == before


def test_a_scheduler_that_is_not_there_is_one_line(data, capsys):
    Path("own.toml").write_text("time_limit_s = 5\nmemory_limit_gb = 1\npatience_s = 0.3\n")
    argv = ["batch", "a", "--out", "out", "--settings", "own.toml", "--scheduler", "tcp://127.0.0.1:9", "--quiet"]
    assert main(argv) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "--scheduler tcp://127.0.0.1:9: no scheduler answers there" in error
    assert written(data / "out") == {}


def test_a_missing_extra_is_one_line(data, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["batch", "a", "--out", "out"]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "pip install 'gmr-traj[batch]'" in error


def made_up(*promises: tuple[str, float, float], passed: bool | None = None, failed: str = "") -> dict:
    """A record as far as its summary goes."""
    keys = {"unit": "mm", "where": "", "before": None}
    entries = [
        {"name": name, "sentence": name, "value": value, "bar": bar, "held": value is not None and value <= bar, **keys}
        for name, value, bar in promises
    ]
    out: dict = {
        "status": "failed" if failed else "done",
        "reason": failed or None,
        "outputs": {},
        "input": {"path": ""},
    }
    figures = dict.fromkeys(("over_frames", "limit_frames", "jumps", "frames"), 1)
    names = ("speed_ratio", "drift_p95", "drift_max", "slide_mean", "float_p95", "self_depth", "sole_lowest")
    figures = {**figures, **dict.fromkeys((*names, "floor_lowest", "seconds"), 0.5)}
    if promises:
        held = all(entry["held"] for entry in entries)
        out["certificate"] = {"held": held, "promises": entries, "before": figures, "after": figures}
    if passed is not None:
        out["verify"] = {"passed": passed, "audit": {"failures": [] if passed else ["it falls"]}, "rollouts": []}
    return out


def test_what_falls_short_most_is_first():
    records = {
        "fine": made_up(("drift", 1.0, 10.0), ("depth", 5.0, 10.0)),
        "near": made_up(("drift", 9.0, 10.0)),
        "broken": made_up(("drift", 11.0, 10.0)),
        "twice": made_up(("drift", 10.5, 10.0), ("depth", 10.5, 10.0)),
        "far": made_up(("drift", 50.0, 10.0)),
        "zero": made_up(("jumps", 2.0, 0.0)),
        "no number": made_up(("drift", None, 10.0)),
        "fallen": made_up(("drift", 1.0, 10.0), passed=False),
        "failed": made_up(failed="no clip"),
    }
    order = [name for name, _, _ in ranked(records)]
    assert order == ["failed", "twice", "no number", "far", "zero", "fallen", "broken", "near", "fine"]
    assert shortfall(records["fine"]).sentence == "depth" and shortfall(records["fallen"]).sentence == "it falls"
    found = totals(records.values())
    assert (found["clips"], found["done"], found["held"], found["broken"], found["not_followed"]) == (9, 8, 3, 5, 1)
    assert found["before"]["jumps"] == 8 and found["frames"] == 8


@pytest.mark.parametrize(
    ("records", "code"),
    [
        ([], ExitCode.OK),
        ([made_up(("drift", 1.0, 2.0), passed=True)], ExitCode.OK),
        ([made_up(("drift", 1.0, 2.0), passed=False)], ExitCode.NOT_FOLLOWED),
        ([made_up(("drift", 3.0, 2.0)), made_up(passed=False)], ExitCode.BROKEN_PROMISE),
        ([made_up(("drift", 3.0, 2.0)), made_up(failed="no clip")], ExitCode.CLIP_FAILED),
    ],
)
def test_the_exit_code_is_that_of_the_worst(records, code):
    assert exit_code({str(k): one for k, one in enumerate(records)}) is code


def test_which_recordings_are_wanted():
    assert (wanted(None), wanted("all"), wanted("worst:3")) == (0, None, 3)
    for wrong in ("worst", "worst:0", "worst:-1", "3"):
        with pytest.raises(BatchError, match=r"expected worst:10"):
            wanted(wrong)
