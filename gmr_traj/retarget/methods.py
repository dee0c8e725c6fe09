"""The retargeting methods by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from gmr_traj.human_motion import HumanMotion
from gmr_traj.retarget import gmr, gmr_code, phc, protomotions
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.options import Options, Solved
from gmr_traj.robot import Robot

Method = Callable[[HumanMotion, Robot, BodyMap, Options], Solved]

METHODS: Mapping[str, Method] = {
    "gmr": gmr.solve,
    "gmr-code": gmr_code.solve,
    "phc": phc.solve,
    "phc-paper": partial(phc.solve, height="mean-minimum"),  # the GMR paper's repair of its height
    "phc-adam": partial(phc.solve, descent="adam"),  # PHC since November 2024
    "protomotions": protomotions.solve,
    "protomotions-paper": partial(protomotions.solve, height="clip"),  # one height a clip
}
