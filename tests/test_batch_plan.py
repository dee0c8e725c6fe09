"""What a run has to do, records, putting files in place, and the lock of the output folder."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from gmr_traj.batch import folder
from gmr_traj.batch.fingerprint import resource_hashes, sha256, versions
from gmr_traj.batch.plan import Expected, make_plan
from gmr_traj.batch.publish import publish
from gmr_traj.batch.records import read_records, record_path
from gmr_traj.batch.settings import load_settings
from gmr_traj.batch.work import Ended
from gmr_traj.exceptions import BatchError, ResourceError

EXPECTED = Expected({"steps": ["refine"], "window": None}, {"problem": "1"}, {"casadi": "3"})


@pytest.fixture
def place(tmp_path):
    """An input, an output folder and a folder for unfinished work."""
    (tmp_path / "walk.pkl").write_bytes(b"walk")
    (tmp_path / "out" / ".batch" / "run").mkdir(parents=True)
    return tmp_path


def do(place: Path, content: bytes | None = b"clip", *, file="walk.npz", failed="", expected=EXPECTED, name="sub/walk"):
    """Publish a clip that was done, or failed."""
    run, source = place / "out" / ".batch" / "run", place / "walk.pkl"
    attempt = run / "0.0.x"
    attempt.mkdir()
    outputs = {}
    if content is not None:
        (attempt / file).write_bytes(content)
        outputs = {"clip": {"file": file, "sha256": sha256(attempt / file), "bytes": len(content)}}
    result = {"failed": failed, "sha256": sha256(source), "outputs": outputs, "content": {"notes": []}}
    (attempt / "result.json").write_text(json.dumps(result))
    old = read_records(place / "out").get(name)
    return publish(Ended(name, folder=attempt), source, expected, place / "out", run, 0, old)


def why(place: Path, expected=EXPECTED, **options) -> list[str]:
    out = place / "out"
    inputs = {"sub/walk": place / "walk.pkl"}
    return [todo.why for todo in make_plan(inputs, read_records(out), lambda *_: expected, out, **options)]


def outputs(place: Path) -> dict[str, bytes]:
    """Everything in the output folder but the state."""
    out = place / "out"
    paths = (path.relative_to(out) for path in out.rglob("*") if path.is_file())
    return {path.as_posix(): (out / path).read_bytes() for path in paths if path.parts[0] != ".batch"}


def test_what_is_done_is_not_done_again(place):
    assert why(place) == ["new"]
    record = do(place)
    assert outputs(place).keys() == {"sub/walk.npz", "sub/walk.record.json"}
    assert record == read_records(place / "out")["sub/walk"]
    assert list((place / "out" / ".batch" / "run").iterdir()) == []
    assert why(place) == []
    assert why(place, force=True) == ["forced"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"options": {"steps": ["refine"], "window": 2.0}}, "window changed"),
        ({"resources": {"problem": "2"}}, "problem changed"),
        ({"resources": {"problem": "1", "map": "1"}}, "map changed"),
        ({"versions": {"casadi": "4"}}, "casadi changed"),
    ],
)
def test_what_has_changed_is_done_again(place, change, reason):
    do(place)
    assert why(place, Expected(**{**vars(EXPECTED), **change})) == [reason]


def test_changed_files_are_done_again(place):
    do(place)
    (place / "out" / "sub" / "walk.npz").write_bytes(b"edited")
    assert why(place) == ["walk.npz is not what was written"]
    (place / "out" / "sub" / "walk.npz").unlink()
    assert why(place) == ["walk.npz is missing"]
    (place / "walk.pkl").write_bytes(b"another walk")
    assert why(place) == ["input changed"]


def test_a_failed_clip_leaves_its_reason_and_no_file(place):
    do(place)
    do(place, None, failed="it fell")
    assert outputs(place).keys() == {"sub/walk.record.json"}
    record = read_records(place / "out")["sub/walk"]
    assert (record["status"], record["reason"], record["outputs"]) == ("failed", "it fell", {})
    assert why(place) == ["failed before"]
    assert why(place, retry_failed=False) == []


def test_a_clip_in_another_format_takes_the_old_one_s_place(place):
    do(place)
    do(place, file="walk.csv")
    assert outputs(place).keys() == {"sub/walk.csv", "sub/walk.record.json"}


def test_a_file_that_was_edited_is_not_removed(place):
    do(place)
    (place / "out" / "sub" / "walk.npz").write_bytes(b"edited")
    do(place, None, failed="it fell")
    assert outputs(place)["sub/walk.npz"] == b"edited"


def test_equal_results_have_equal_records(place):
    do(place)
    first = outputs(place)
    do(place)
    assert outputs(place) == first


@pytest.mark.parametrize("text", ["", "{", "[]", '{"layout": 0}', '{"layout": 1, "status": "done"}'])
def test_a_record_that_is_none_is_written_anew(place, text):
    do(place)
    record_path(place / "out", "sub/walk").write_text(text)
    assert why(place) == ["new"]


def test_files_of_others_are_not_overwritten(place):
    (place / "out" / "sub").mkdir()
    (place / "out" / "sub" / "walk.npz").write_bytes(b"precious")
    with pytest.raises(BatchError, match="no record says that it is a batch's"):
        why(place)
    assert why(place, force=True) == ["new"]


def test_a_folder_is_for_one_run_at_a_time(tmp_path):
    out = tmp_path / "made" / "out"
    script = (
        "import sys, pathlib; from gmr_traj.batch.folder import locked\nwith locked(pathlib.Path(sys.argv[1])): pass"
    )
    with folder.locked(out) as run:
        assert run.is_dir() and run.parent == out / ".batch"
        done = subprocess.run([sys.executable, "-c", script, str(out)], capture_output=True, text=True)
        assert "another batch is writing there (process" in done.stderr
    assert [path.name for path in (out / ".batch").iterdir()] == ["lock"]


def test_what_a_killed_run_left_is_removed(tmp_path):
    (tmp_path / ".batch" / "run-0" / "0.0.x").mkdir(parents=True)
    with folder.locked(tmp_path) as run:
        assert [path.name for path in run.parent.iterdir() if path.is_dir()] == [run.name]


def test_an_output_folder_must_be_one(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(BatchError, match="this is a file"), folder.locked(tmp_path / "file"):
        pass


def test_hashes_are_of_what_the_steps_depend_on():
    robot = resource_hashes("unitree_g1", "refine", None, None, ("refine",), human=False)
    assert {"robot/robot.toml", "robot/unitree_g1.xml", "problem", "configs/certificate"} <= robot.keys()
    assert not any("batch" in name or "verify" in name or "_to_" in name for name in robot)
    human = resource_hashes("unitree_g1", "refine", None, None, ("retarget", "verify"), human=True)
    assert {"configs/lafan1_to_unitree_g1", "configs/verify_audit"} <= human.keys() and "problem" not in human


def test_versions_name_what_computes():
    assert {"gmr-traj", "python", "casadi", "mujoco", "numpy"} <= versions().keys()


def test_settings_are_data(tmp_path):
    shipped = load_settings()
    assert shipped.limits.seconds > 0 and shipped.limits.memory > 10**9 and shipped.limits.threads == 1
    text = "time_limit_s = 5\nmemory_limit_gb = 0.5\npatience_s = 1\n"
    (tmp_path / "own.toml").write_text(text + "retries = 0\n")
    assert load_settings(tmp_path / "own.toml").limits.memory == 5 * 10**8
    for wrong in ("retries = -1\n", "threads = 0\n", "cores = 2\n"):
        (tmp_path / "own.toml").write_text(text + wrong)
        with pytest.raises(BatchError, match=r"own.toml"):
            load_settings(tmp_path / "own.toml")
    with pytest.raises(ResourceError):
        load_settings("absent")
