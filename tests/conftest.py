"""Fixtures that all tests share."""

from __future__ import annotations

import os
import tempfile
from importlib import metadata
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot

CHECKOUT = Path(__file__).resolve().parent.parent
TEST_DATA = Path(__file__).resolve().parent / "data"

# No test writes into the user's cache.
_CACHE = tempfile.TemporaryDirectory(prefix="gmr-traj-cache-", ignore_cleanup_errors=True)
os.environ["XDG_CACHE_HOME"] = _CACHE.name

# Examples that compile or solve take as long as the machine lets them.
hypothesis.settings.register_profile("gmr_traj", deadline=None, derandomize=True)
hypothesis.settings.load_profile("gmr_traj")


@pytest.fixture(scope="session")
def g1() -> Robot:
    """The Unitree G1 with 29 joints."""
    return load_robot("unitree_g1")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of recorded motion, which is not part of the project."""
    folder = Path(os.environ.get("GMR_TRAJ_DATA") or CHECKOUT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no recorded motion: {folder} does not exist; set GMR_TRAJ_DATA to the folder that holds it")
    return folder


def example_robot_file(name: str) -> Path:
    """A robot description of the package example-robot-data; skips where that is not installed."""
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data is not installed; it is in the extra 'test'")
    found = [file for file in files if file.name == name]
    if not found:
        pytest.skip(f"this version of example-robot-data has no {name}")
    return Path(str(found[0].locate())).resolve()


@pytest.fixture(scope="session")
def talos_toml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot.toml for Talos whose model is the URDF of example-robot-data."""
    urdf = example_robot_file("talos_reduced.urdf")
    text = (TEST_DATA / "talos" / "robot.toml").read_text(encoding="utf-8")
    path = tmp_path_factory.mktemp("talos") / "robot.toml"
    path.write_text(text.replace('"talos_reduced.urdf"', f'"{urdf.as_posix()}"'), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def talos(talos_toml: Path) -> Robot:
    """Talos: a robot of another maker, from a URDF with meshes, a fixed base and fixed joints."""
    return load_robot(talos_toml)


def random_configurations(robot: Robot, count: int, seed: int) -> np.ndarray:
    """Configurations within the joint ranges, base anywhere within 2 m with any orientation.  # (count, 7 + n)"""
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    joints = rng.uniform(robot.position_lower, robot.position_upper, size=(count, robot.dof))
    return np.hstack([rng.uniform(-2, 2, size=(count, 3)), quaternions, joints])
