"""A person's skeleton from anthropometry, for motions of the SMPL family that come without their body model."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import ClipError, ResourceError
from gmr_traj.formats.human import smpl_joints
from gmr_traj.toml_table import Table

_PEOPLE = (0.5, 2.5)  # [m]


@cache
def _table() -> Table:
    path = resources.find("configs", "smpl_skeleton")
    return Table(path, "", tomllib.loads(path.read_text(encoding="utf-8")), ResourceError)


def stature(betas: np.ndarray) -> float:
    """How tall a person of the SMPL family is taken for [m]: ``mean + per_beta * betas[0]``, as GMR does.

    Args:
        betas: shape parameters, may be empty.

    Raises:
        ClipError: nobody is that tall.
    """
    table = _table().table("stature")
    first = float(betas[0]) if len(betas) else 0.0
    height = table.number("mean") + table.number("per_beta") * first
    if not _PEOPLE[0] <= height <= _PEOPLE[1]:
        raise ClipError(f"betas[0] is {first:g}, which makes a person of {height:.2f} m; expected -8 to 8")
    return height


def mean_joints(model: str, betas: np.ndarray) -> np.ndarray:
    """Where the joints are in their parents' frames in the T-pose [m], the pelvis at the origin.

    Mean proportions times the stature that ``betas[0]`` gives; further betas change nothing.

    Args:
        model: ``smpl`` has 24 joints here; ``smplx`` and ``smplh`` the 22 of the body.
        betas: shape parameters.

    Returns:
        Offsets, x to the left, y up, z to the front.  # (J, 3)
    """
    table = _table().table("joints")
    names = smpl_joints.JOINTS[model][: None if model == "smpl" else smpl_joints.BODY]
    return stature(betas) * np.array([table.point(joint) for joint in names])
