"""CasADi functions as machine code: the same bits, made in the background, and never in anybody's way."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from retarget_setup import cut, dance, human_of

from gmr_traj.c_compiler import COMPILER
from gmr_traj.machine_code import compiled, wait
from gmr_traj.retarget.body_map import load_map
from gmr_traj.retarget.retarget import retarget
from gmr_traj.robot import Robot

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler, cc, to try")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache folder of this test alone, with a compiler to fill it where there is one."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv(COMPILER, "cc")
    return tmp_path / "gmr-traj" / "functions"


def waltz(salt: float) -> ca.Function:
    """Something with all that rounds differently when it is contracted or reordered; another for every salt."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2, 4)
    product = ca.cross(x, ca.vertcat(ca.sin(x[0]), ca.atan2(x[1], x[2]), salt))
    many = ca.if_else(x[0] > 0, ca.tan(y), ca.exp(y) / 3.0) + ca.fmax(y, 0.1) * y - y**2
    return ca.Function("waltz", [x, y], [ca.densify(product), many, ca.sumsqr(y) + ca.dot(x, product)])


def when_made(function: ca.Function, folder: Path) -> ca.Function:
    """What there is when the compiler is done."""
    started = time.monotonic()
    while (made := compiled(function)) is function or list(folder.glob("*.lock")):
        assert time.monotonic() - started < 60.0, sorted(folder.iterdir())
        time.sleep(0.05)
    return made


@needs_compiler
def test_machine_code_gives_the_same_bits(folder: Path):
    function = waltz(0.3)
    assert compiled(function) is function  # nobody waits for the compiler
    made = when_made(function, folder)
    rng = np.random.default_rng(1)
    for _ in range(200):
        point = [rng.normal(size=(3, 1)), rng.normal(size=(2, 4))]
        for a, b in zip(function.call(point), made.call(point), strict=True):
            np.testing.assert_array_equal(a.full(), b.full())


@needs_compiler
def test_a_library_is_made_once_and_found_by_what_is_in_the_function(folder: Path):
    when_made(waltz(0.3), folder)
    assert [path.suffix for path in folder.iterdir()] == [".so"]
    assert compiled(waltz(0.3)).class_name() == "External"  # the same operations, written down anew
    assert compiled(waltz(0.4)).class_name() != "External"


def test_without_a_compiler_nothing_is_written(folder: Path, monkeypatch: pytest.MonkeyPatch):
    function = waltz(0.5)
    for name in ("none", "no-such-compiler"):
        monkeypatch.setenv(COMPILER, name)
        assert compiled(function) is function
    monkeypatch.delenv(COMPILER)
    monkeypatch.setenv("PATH", str(folder))
    assert compiled(function) is function
    assert not folder.exists()


def test_a_compiler_that_fails_is_not_tried_again(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    count = tmp_path / "count"
    broken = tmp_path / "cc"
    broken.write_text(f"#!/bin/sh\necho once >> {count}\necho 'no licence' >&2\nexit 1\n", encoding="ascii")
    broken.chmod(0o755)
    monkeypatch.setenv(COMPILER, str(broken))
    function, started = waltz(0.6), time.monotonic()
    while not list(folder.glob("*.failed")) or list(folder.glob("*.lock")):
        assert compiled(function) is function
        assert time.monotonic() - started < 20.0
        time.sleep(0.02)
    assert compiled(function) is function
    assert [path.read_text(encoding="ascii") for path in folder.iterdir()] == ["no licence\n"]
    assert count.read_text(encoding="ascii") == "once\n"


def test_a_folder_that_cannot_be_written_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    in_the_way = tmp_path / "gmr-traj"
    in_the_way.write_text("a file", encoding="ascii")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv(COMPILER, "cc" if shutil.which("cc") else "sh")
    function = waltz(0.7)
    assert compiled(function) is function
    assert in_the_way.read_text(encoding="ascii") == "a file"


def library_of(function: ca.Function, folder: Path) -> Path:
    before = set(folder.glob("*.so"))
    when_made(function, folder)
    [made] = set(folder.glob("*.so")) - before
    return made


@needs_compiler
def test_a_library_that_others_could_have_written_is_not_used(folder: Path):
    function = waltz(0.8)
    library = library_of(function, folder)
    library.chmod(0o722)
    assert compiled(function) is function
    library.chmod(0o700)
    assert compiled(function) is not function
    folder.chmod(0o777)
    assert compiled(function) is function


@needs_compiler
@pytest.mark.parametrize("content", ["nothing", "another function"])
def test_a_library_that_is_something_else_is_not_used(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str
):
    function = waltz(0.9)
    right, wrong = library_of(function, folder), library_of(waltz(0.91), folder)
    elsewhere = tmp_path / "elsewhere" / "gmr-traj" / "functions"
    elsewhere.mkdir(mode=0o700, parents=True)
    (elsewhere / right.name).write_bytes(b"nothing" if content == "nothing" else wrong.read_bytes())
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    assert compiled(function) is function
    (elsewhere / right.name).unlink()
    (elsewhere / right.name.replace(".so", ".lock")).touch()  # somebody is at it
    assert compiled(function) is function


def test_a_user_without_a_home_has_no_folder(folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    function = waltz(0.93)
    assert compiled(function) is function
    wait(0.0)


def test_a_process_that_cannot_be_started_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_, **__):
        raise OSError("no more processes")

    monkeypatch.setenv(COMPILER, "sh")
    monkeypatch.setattr("subprocess.run", refuse)
    function = waltz(0.94)
    assert compiled(function) is function
    assert list(folder.iterdir()) == []


def test_waiting_ends_with_the_last_compiler_or_in_time(folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv(COMPILER, "sh")
    folder.mkdir(parents=True)
    wait(10.0)
    lock = folder / "a.lock"
    lock.touch()
    started = time.monotonic()
    wait(0.2)
    assert 0.2 <= time.monotonic() - started < 5.0
    os.utime(lock, (0, 0))  # a compiler that was killed long ago
    wait(10.0)
    assert time.monotonic() - started < 5.0


@needs_compiler
def test_retargeting_is_the_same_with_either(g1: Robot, folder: Path, monkeypatch: pytest.MonkeyPatch):
    body_map = load_map("lafan1_to_unitree_g1", g1)
    human = cut(human_of(g1, body_map, dance(g1), height=1.75), 0, 12, noise=0.02)
    first = retarget(human, g1, body_map).motion.qpos
    started = time.monotonic()
    while len(list(folder.glob("*.so"))) < 3:
        assert time.monotonic() - started < 120.0
        time.sleep(0.1)
    np.testing.assert_array_equal(retarget(human, g1, body_map).motion.qpos, first)
    monkeypatch.setenv(COMPILER, "none")
    np.testing.assert_array_equal(retarget(human, g1, body_map).motion.qpos, first)
