"""Which files a refinement may write."""

import os

import pytest

from gmr_traj.cli.outputs import plan, publish, staged
from gmr_traj.exceptions import GmrTrajError


@pytest.fixture
def clip(tmp_path):
    path = tmp_path / "walk.pkl"
    path.write_bytes(b"clip")
    return path


def test_names_beside_the_input(clip):
    outputs = plan(clip, None, None, None, False)
    assert outputs.clip == clip.with_name("walk_refined.pkl")
    assert outputs.report(outputs.clip).name == "walk_refined.pkl.report.json"
    assert outputs.unconverged.name == "walk_refined.unconverged.pkl"


def test_another_format_has_its_suffix(clip):
    assert plan(clip, None, "unitree-csv", None, False).clip.name == "walk_refined.csv"


def test_the_input_is_never_overwritten_not_even_through_a_link(clip, tmp_path):
    link = tmp_path / "link.pkl"
    link.symlink_to(clip)
    for output in (clip, link, tmp_path / "." / "walk.pkl"):
        with pytest.raises(GmrTrajError, match="never overwritten"):
            plan(clip, output, None, None, True)
    with pytest.raises(GmrTrajError, match="never overwritten"):
        plan(clip, None, None, clip, True)


@pytest.mark.parametrize("name", ["out.pkl", "out.pkl.report.json", "contacts.json"])
def test_what_exists_needs_force(clip, tmp_path, name):
    (tmp_path / name).write_text("precious")
    arguments = (clip, tmp_path / "out.pkl", None, tmp_path / "contacts.json")
    with pytest.raises(GmrTrajError, match=f"{name}: this file exists"):
        plan(*arguments, False)
    assert plan(*arguments, True).clip == tmp_path / "out.pkl"


def test_folders_are_not_files(clip, tmp_path):
    with pytest.raises(GmrTrajError, match="this is a folder"):
        plan(clip, tmp_path, None, None, True)
    with pytest.raises(GmrTrajError, match="there is no folder"):
        plan(clip, tmp_path / "absent" / "out.pkl", None, None, True)


def test_staged_files_vanish_unless_published(tmp_path):
    target = tmp_path / "out.npz"
    with pytest.raises(KeyboardInterrupt), staged(target) as path:
        assert path.name == "out.npz" and path.parent.parent == tmp_path
        path.write_bytes(b"half")
        raise KeyboardInterrupt
    assert os.listdir(tmp_path) == []
    with staged(target) as path:
        path.write_bytes(b"whole")
        publish(path, target, tmp_path / "out.npz.report.json", "{}\n")
    assert sorted(os.listdir(tmp_path)) == ["out.npz", "out.npz.report.json"]
    assert target.read_bytes() == b"whole"
