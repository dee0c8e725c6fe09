"""What a result depends on beside its input: versions, and the content of every file of settings."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

from gmr_traj import resources
from gmr_traj._version import __version__
from gmr_traj.problem_base import files_that_count
from gmr_traj.robot_toml import read_robot_toml

# The packages whose arithmetic is in the results.
PACKAGES = ("casadi", "daqp", "mujoco", "numpy", "pin", "python-fcl", "scipy")
# Settings of what a batch does not do, or of how it does it.
_NO_MATTER = ("batch", "compare")
_REFINE = ("certificate", "inspect")


def versions() -> dict[str, str]:
    """Versions of gmr-traj, Python and the packages that compute."""
    found = {"gmr-traj": __version__, "python": ".".join(platform.python_version_tuple()[:2])}
    return {**found, **{name: metadata.version(name) for name in PACKAGES}}


def sha256(path: Path) -> str:
    """Hash of a file's content, hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def resource_hashes(
    robot: str, problem: str, map_: str | None, body_model: Path | None, steps: Iterable[str], human: bool
) -> dict[str, str]:
    """Hashes of the files that a clip's result depends on, by what they are.

    Which map a human motion needs is known only when it is read, so all configs of retargeting count.

    Args:
        robot: name or path.
        problem: name or path; counts where ``refine`` is among the steps.
        map_: name or path; None for the one that ships for the rig.
        body_model: SMPL model, where given.
        steps: of ``retarget``, ``refine``, ``verify``.
        human: whether the input is a human motion.

    Raises:
        ResourceError: one of them does not exist.
        RobotError: the robot.toml names no model.
        ProblemError: a problem file cannot be read.
    """
    files = {f"robot/{path.name}": path for path in _robot_files(robot)}
    if "refine" in steps:
        own, *others = files_that_count(resources.find("problems", problem))
        files["problem"] = own
        same = own.read_bytes()  # a copy of a problem that ships counts as that one
        files.update({f"problem/{other.name}": other for other in others if other.read_bytes() != same})
    for name in resources.names("configs"):
        if _counts(name, tuple(steps), human):
            files[f"configs/{name}"] = resources.find("configs", name)
    if human and map_ is not None:
        files["map"] = resources.find("configs", map_)
    if human and body_model is not None:
        files["body model"] = body_model
    return {what: _hash(path, path.stat().st_mtime_ns) for what, path in sorted(files.items())}


def _counts(name: str, steps: tuple[str, ...], human: bool) -> bool:
    if name in _NO_MATTER:
        return False
    if name.startswith("verify_"):
        return "verify" in steps
    if name in _REFINE:
        return True  # what is measured on every clip is
    return human


def _robot_files(robot: str) -> Iterator[Path]:
    path = resources.find("models", robot)
    if path.is_dir():
        path = path / "robot.toml"
    yield path
    yield read_robot_toml(path).model


@cache
def _hash(path: Path, changed: int) -> str:
    return sha256(path)
