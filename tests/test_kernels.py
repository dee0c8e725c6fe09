"""The compiled kernels: the same bits as Python's, and nothing lost where they cannot be made or kept."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from optimiser_setup import every_operation

from gmr_traj.band.cholesky import BlockCholesky
from gmr_traj.band.ordering import order
from gmr_traj.band.products import Products
from gmr_traj.c_compiler import COMPILER
from gmr_traj.collision.broadphase import candidates
from gmr_traj.collision.limbs import limbs
from gmr_traj.collision.push_out import normal_equations
from gmr_traj.collision.untangle import _surroundings
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.frames import Frames
from gmr_traj.kernels import build, library
from gmr_traj.kernels.library import kernels
from gmr_traj.kernels.numpy_loops import loop
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot
from gmr_traj.threads import VARIABLE, side_by_side

SOURCES = sorted(Path(build.__file__).parent.glob("*.c"))
compiled = pytest.mark.skipif(library.kernels() is None, reason="no C compiler here: there are no kernels to test")


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "gmr-traj"


def _both(monkeypatch: pytest.MonkeyPatch, compute: Callable[[], list[np.ndarray]]) -> None:
    """The same bits with kernels on two threads and on one, and without."""
    found = []
    for wanted, threads in (("any", "2"), ("any", "1"), ("none", "1")):
        monkeypatch.setenv(COMPILER, "none") if wanted == "none" else monkeypatch.delenv(COMPILER, raising=False)
        monkeypatch.setenv(VARIABLE, threads)
        found.append([array.tobytes() for array in compute()])
    assert found[0] == found[1] == found[2]


@compiled
@pytest.mark.parametrize("count", [1, 2, 7, 400])
def test_factors_are_the_same_bits(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """Frames that couple with three neighbours, and unknowns that are carried over stretches of them."""
    rng = np.random.default_rng(count)
    width, extra = 5, 6
    n = count * width + extra
    frame = np.concatenate([np.repeat(np.arange(count), width), np.full(extra, -1)])
    ends = np.sort(rng.integers(0, count, (2, extra)), axis=0)
    near = np.abs(frame[:, None] - frame) <= 3
    for k, (first, last) in enumerate(ends.T, count * width):
        near[k] = near[:, k] = (frame >= first) & (frame <= last)
        near[k, k] = True
    rows, columns = np.nonzero(np.tril(near))
    rows, columns = (np.concatenate([a, a[::3]]) for a in (rows, columns))  # shares of the same entry
    values = rng.normal(size=len(rows))
    values[rows == columns] += 2.0 * n
    couplings = [(rows, columns)]
    right = rng.normal(size=(2, n))

    def compute() -> list[np.ndarray]:
        factor = BlockCholesky(order(frame, couplings), n, couplings)
        assert factor.factor(values, right[0])
        return [factor.finish(), factor.solve(right[1])]

    _both(monkeypatch, compute)


@compiled
@pytest.mark.parametrize("count", [150, 1023])
def test_functions_of_frames_are_the_same_bits(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 2)
    function = ca.Function("f", [x, p], every_operation(x, p))
    rng = np.random.default_rng(count)
    columns, parameters = np.arange(2 * count).reshape(count, 2), rng.uniform(-2, 2, (2, count))
    unknowns = rng.uniform(-3.0, 3.0, 2 * count)  # roots and logarithms of negative numbers among them

    def compute() -> list[np.ndarray]:
        with np.errstate(all="ignore"):
            machine = Frames(function, columns, parameters)
            machine.at(unknowns)
        return [np.where(np.isnan(output), 1e300, output) for output in machine.outputs]

    _both(monkeypatch, compute)


@compiled
def test_functions_of_few_frames_are_casadi_s_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 2)
    function = ca.Function("f", [x, p], every_operation(x, p))
    rng = np.random.default_rng(1)
    columns, parameters = np.arange(298).reshape(149, 2), rng.uniform(-2, 2, (2, 149))
    unknowns = rng.uniform(-3.0, 3.0, 298)

    def compute() -> list[np.ndarray]:
        machine = Frames(function, columns, parameters, evaluations=1000)
        assert (machine._machine is None) == (kernels() is None)
        machine.at(unknowns)
        return [np.where(np.isnan(output), 1e300, output) for output in machine.outputs]

    _both(monkeypatch, compute)


@compiled
@pytest.mark.parametrize("count", [1, 1001])
def test_products_are_the_same_bits(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    rng = np.random.default_rng(count)
    s, w = rng.normal(size=(count, 4, 7)), rng.normal(size=(count, 4, 4))
    w += w.transpose(0, 2, 1)
    s[:, rng.random((4, 7)) < 0.4] = 0.0
    s[:, 0] = 1.0
    w[:, 2, 3] = w[:, 3, 2] = 0.0
    column, row = np.nonzero(s.any(axis=0).T)
    at = np.nonzero(w.any(axis=0))
    out = np.empty((28, count))

    def compute() -> list[np.ndarray]:
        products = Products((row, column), s[:, row, column].T.copy(), at, w[:, *at].T.copy())
        products.multiply(out)
        np.testing.assert_allclose(out, (s.transpose(0, 2, 1) @ w @ s)[:, *products.at].T, atol=1e-12)
        return [out.copy()]

    _both(monkeypatch, compute)


@compiled
@pytest.mark.parametrize("margin", [-0.02, 0.0, 0.3])
def test_close_capsules_are_the_same_bits(g1: Robot, monkeypatch: pytest.MonkeyPatch, margin: float) -> None:
    rng = np.random.default_rng(4)
    qpos = np.tile(g1.nominal, (150, 1))
    qpos[:, 7:] = rng.uniform(g1.position_lower, g1.position_upper, (150, g1.dof))
    at = placements(g1, qpos)
    limb = next(limb for limb in limbs(g1) if not limb.feet)
    around = _surroundings(g1, limb, *at)
    angles = rng.uniform(-1.0, 1.0, (150, len(limb.joints)))

    def compute() -> list[np.ndarray]:
        found = candidates(g1, *at, margin)
        points = limb.ends(angles)[0]
        pairs = np.array([candidate.pair for candidate in found])
        found_by_kind = [*(c.frames for c in found), *(c.clearance for c in found)]
        target = limb.ends(0.9 * angles)[0]
        model = normal_equations(around, 0.9 * angles, target, angles, margin)
        return [pairs, *found_by_kind, *around.rows(points, margin), around.depths(points), *model]

    _both(monkeypatch, compute)


def test_numpy_is_not_asked_for_what_it_has_not() -> None:
    assert loop(np.sin) is not None and loop(np.arctan2) is not None
    assert loop(np.bitwise_and) is None and loop(np.modf) is None and loop(np.less) is None


@compiled
def test_a_library_is_made_once(empty_cache: Path) -> None:
    path = build.cached("kernels", SOURCES)
    assert path is not None and path.parent == empty_cache
    made = path.stat().st_mtime_ns
    assert build.cached("kernels", SOURCES) == path and path.stat().st_mtime_ns == made
    assert [found.name for found in empty_cache.iterdir()] == [path.name]


@compiled
@pytest.mark.parametrize("damage", [b"", b"no library", None])
def test_a_damaged_library_is_made_again(empty_cache: Path, damage: bytes | None) -> None:
    path = build.cached("kernels", SOURCES)
    assert path is not None
    path.write_bytes(path.read_bytes()[:-100] if damage is None else damage)
    again = build.cached("kernels", SOURCES)
    assert again is not None and ctypes.CDLL(str(again)).frames_width() > 0


@compiled
def test_processes_that_compile_at_the_same_time(empty_cache: Path) -> None:
    code = "from gmr_traj.kernels.library import description; print(description())"
    command = [sys.executable, "-c", code]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    assert [process.communicate()[0].strip() for process in running] == ["compiled"] * 4
    assert [found.suffix for found in empty_cache.iterdir()] == [".so"]


@pytest.mark.parametrize("trouble", ["no compiler", "a compiler that fails", "no room", "asked for"])
def test_without_a_library_python_computes(
    trouble: str, tmp_path: Path, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.delenv(COMPILER, raising=False)
    if trouble != "no compiler":
        script = folder / "cc"
        script.write_text("#!/bin/sh\nexit 1\n")
        script.chmod(0o755)
    if trouble == "no room":
        monkeypatch.setenv("XDG_CACHE_HOME", str(script))  # a file
    if trouble == "asked for":
        monkeypatch.setenv(COMPILER, "none")
        assert library.kernels() is None
    library._loaded.cache_clear()
    try:
        assert library.description() == "python"
        assert not empty_cache.is_dir() or not any(empty_cache.iterdir())
    finally:
        library._loaded.cache_clear()


def test_tasks_give_their_results_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    for threads in ("1", "2"):
        monkeypatch.setenv(VARIABLE, threads)
        assert side_by_side([lambda: 1, lambda: 2, lambda: 3]) == [1, 2, 3]


def test_what_a_task_raises_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "2")

    def fail() -> int:
        raise ValueError("here")

    with pytest.raises(ValueError, match="here"):
        side_by_side([lambda: 1, fail])


@pytest.mark.parametrize("wanted", ["0", "-1", "two", "1.5", "²"])
def test_a_number_of_threads_that_is_none(monkeypatch: pytest.MonkeyPatch, wanted: str) -> None:
    monkeypatch.setenv(VARIABLE, wanted)
    with pytest.raises(GmrTrajError, match=f"{VARIABLE} is .*; expected a number of threads"):
        side_by_side([lambda: 1, lambda: 2])
    assert os.environ[VARIABLE] == wanted
