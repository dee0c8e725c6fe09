"""Which motions a batch is about, and what their outputs are called."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmr_traj.batch.collect import Input, collect
from gmr_traj.batch.naming import name_inputs
from gmr_traj.exceptions import BatchError

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


@pytest.fixture
def data(tmp_path, monkeypatch):
    """Motions in folders, with other files among them; the working folder."""
    monkeypatch.chdir(tmp_path)
    for name in (
        "a/walk.pkl",
        "a/deep/run.BVH",
        "a/notes.txt",
        "a/.hidden.npz",
        "a/.cache/x.npz",
        "b/walk.csv",
        "b/v.mp4",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("something")
    (tmp_path / "a" / "kick.txt").write_bytes((EXAMPLES / "kick.txt").read_bytes())
    return tmp_path


def found(*given: str, out: str = "out") -> list[tuple[str, str]]:
    """Paths relative to the working folder, and the places they are called after."""
    return [(os.path.relpath(one.path), one.relative.as_posix()) for one in collect(given, Path(out))]


def test_a_folder_is_searched_for_what_looks_like_a_motion(data):
    assert found("a") == [("a/deep/run.BVH", "deep/run.BVH"), ("a/kick.txt", "kick.txt"), ("a/walk.pkl", "walk.pkl")]


def test_a_file_is_taken_whatever_it_is_called(data):
    assert found("a/notes.txt", "b/v.mp4") == [("a/notes.txt", "notes.txt"), ("b/v.mp4", "v.mp4")]


def test_a_pattern_keeps_what_varies_in_it(data):
    assert found("*/walk.*") == [("a/walk.pkl", "a/walk.pkl"), ("b/walk.csv", "b/walk.csv")]
    assert found("a/**/*") == found("a")


def test_a_file_whose_name_looks_like_a_pattern_is_a_file(data):
    Path("a/walk[1].pkl").write_text("something")
    assert found("a/walk[1].pkl") == [("a/walk[1].pkl", "walk[1].pkl")]


def test_a_list_is_called_after_the_folder_that_all_are_in(data):
    Path("list.txt").write_text("# motions\n\na/walk.pkl\n  b/walk.csv \n")
    assert found("@list.txt") == [("a/walk.pkl", "a/walk.pkl"), ("b/walk.csv", "b/walk.csv")]
    Path("list.txt").write_text("a\nb/*.csv\n")
    assert found("@list.txt") == [*found("a"), ("b/walk.csv", "walk.csv")]


def test_nothing_is_taken_twice(data):
    assert found("a", "a/walk.pkl", "a/*.pkl", "./a") == found("a")


def test_the_output_folder_is_no_input(data):
    Path("out").mkdir()
    Path("out/walk.npz").write_text("output")
    assert found(".") == [*[(path, path) for path, _ in found("a")], ("b/walk.csv", "b/walk.csv")]
    assert ("out/walk.npz", "out/walk.npz") not in found("*")


def test_folders_are_entered_once_through_whatever_links(data):
    Path("a/deep/loop").symlink_to(data / "a")
    Path("linked").symlink_to(data / "b")
    assert len(found("a")) == 3
    assert found("linked") == [("linked/walk.csv", "walk.csv")]


def test_what_never_ends_is_not_found_in_a_folder(data):
    os.mkfifo("b/pipe.bvh")
    assert found("b") == [("b/walk.csv", "walk.csv")]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("absent", "absent: no such file or folder"),
        ("c", "c: no motions in this folder; looked for *.bvh"),
        ("a/*.wav", "a/*.wav: this pattern matches no motions"),
        ("@absent.txt", "@absent.txt: cannot be read: No such file"),
        ("@b/empty.txt", "names no motions"),
        ("@bad.txt", "bad.txt: line 2: gone.bvh: no such file"),
        ("@binary", "this is not text"),
        ("out", "the output folder or in it"),
        ("out/sub", "the output folder or in it"),
        ("out/x.npz", "in the output folder"),
    ],
)
def test_what_is_not_there_is_said(data, name, text):
    for folder in ("c", "out/sub"):
        Path(folder).mkdir(parents=True)
    Path("out/x.npz").write_text("x")
    Path("b/empty.txt").write_text("# nothing\n")
    Path("bad.txt").write_text("a\ngone.bvh\n")
    Path("binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BatchError) as caught:
        collect(["a", name], Path("out"))
    assert text in str(caught.value)


def inputs(*places: tuple[str, str]) -> list[Input]:
    return [Input(Path(path), Path(relative)) for path, relative in places]


def names(*places: tuple[str, str], records: dict[str, Path] | None = None) -> list[str]:
    return list(name_inputs(inputs(*places), records or {}))


def test_names_are_places_without_suffix():
    assert names(("/d/a/walk.pkl", "a/walk.pkl"), ("/d/b/run.1.bvh", "b/run.1.bvh")) == ["a/walk", "b/run.1"]


def test_two_suffixes_are_told_apart():
    places = ("/d/walk.pkl", "walk.pkl"), ("/d/walk.bvh", "walk.bvh"), ("/d/run.bvh", "run.bvh")
    assert names(*places) == ["walk_pkl", "walk_bvh", "run"]


def test_two_folders_are_told_apart():
    assert names(("/d/a/walk.pkl", "walk.pkl"), ("/d/b/walk.pkl", "walk.pkl")) == ["a/walk_pkl", "b/walk_pkl"]


def test_a_name_leaves_room_for_the_retargeted_clip():
    assert names(("/d/walk.bvh", "walk.bvh"), ("/d/walk.retargeted.npz", "walk.retargeted.npz")) == [
        "walk_bvh",
        "walk_retargeted_npz",
    ]


def test_a_record_keeps_its_name_whatever_is_added(tmp_path):
    old, new = tmp_path / "a" / "walk.pkl", tmp_path / "a" / "walk.csv"
    for path in (old, new):
        path.parent.mkdir(exist_ok=True)
        path.touch()
    places = (str(old), "walk.pkl"), (str(new), "walk.csv")
    assert names(*places, records={"walk": old}) == ["walk", "walk_csv"]
    assert names((str(new), "walk.csv"), records={"walk": old}) == ["walk_csv"]


def test_a_record_of_data_that_was_moved_gives_its_name_up(tmp_path):
    moved = tmp_path / "walk.pkl"
    moved.touch()
    assert names((str(moved), "walk.pkl"), records={"walk": tmp_path / "before" / "walk.pkl"}) == ["walk"]


def test_the_same_file_by_another_path_has_its_record(tmp_path):
    path = tmp_path / "data" / "walk.pkl"
    path.parent.mkdir()
    path.touch()
    (tmp_path / "link").symlink_to(tmp_path / "data")
    assert names((str(tmp_path / "link" / "walk.pkl"), "walk.pkl"), records={"walk": path}) == ["walk"]


PARTS = st.sampled_from(["a", "b", "walk", "walk.pkl", "walk_pkl", "walk.retargeted", "a.b"])
SUFFIXES = st.sampled_from([".pkl", ".csv", ".npz", ".bvh", ""])


@settings(max_examples=60)
@given(st.data())
def test_no_two_outputs_are_called_the_same(data):
    """Whatever the paths and however they were found: names, and with them the retargeted clips', are distinct."""
    chosen = data.draw(
        st.sets(st.tuples(st.lists(PARTS, max_size=2).map(tuple), PARTS, SUFFIXES), min_size=1, max_size=8)
    )
    places = {}
    for folders, stem, suffix in sorted(chosen):
        path = Path("/", *folders, stem + suffix)
        depth = data.draw(st.integers(1, len(path.parts) - 1))
        places[str(path)] = Path(*path.parts[-depth:]).as_posix()
    found = names(*places.items())
    claimed = [claim for name in found for claim in (name, f"{name}.retargeted")]
    assert len(found) == len(places) and len(set(claimed)) == len(claimed)
