"""A robot small enough for closed forms: a torso, two straight legs of 1 m, an arm with a hand."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Capsule, KeyBody, Robot, Sole

FPS = 50.0
_MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="torso">
      <freejoint/>
      <geom name="torso" type="capsule" fromto="0 0 -0.2 0 0 0.5" size="0.1"/>
      <body name="left_leg" pos="0 0.1 0">
        <joint name="left_hip" axis="0 1 0" range="-2 2"/>
        <geom name="left_leg" type="capsule" fromto="0 0 -0.1 0 0 -0.95" size="0.05"/>
      </body>
      <body name="right_leg" pos="0 -0.1 0">
        <joint name="right_hip" axis="0 1 0" range="-2 2"/>
        <geom name="right_leg" type="capsule" fromto="0 0 -0.1 0 0 -0.95" size="0.05"/>
      </body>
      <body name="arm" pos="0 0.3 0.3">
        <joint name="shoulder" axis="1 0 0" range="-1.5 1.5"/>
        <geom name="arm" type="capsule" fromto="0 0 0 0 0 -0.3" size="0.04"/>
        <body name="hand" pos="0 0 -0.3">
          <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
_POINTS = np.array([[0.1, 0.03, -1.0], [0.1, -0.03, -1.0], [-0.1, 0.03, -1.0], [-0.1, -0.03, -1.0]])
_OUTLINE = np.array([[0.15, 0.0, -1.0]])


def toy() -> Robot:
    """The robot; its soles are on the floor where the base is 1 m above it."""
    parts = ("toe", "toe", "heel", "heel")
    ones = np.ones(3)
    capsules = (
        _capsule("torso", "torso", -0.2, 0.5, 0.1),
        _capsule("left_leg", "left_leg", -0.1, -0.95, 0.05),
        _capsule("right_leg", "right_leg", -0.1, -0.95, 0.05),
        _capsule("arm", "arm", 0.0, -0.3, 0.04),
    )
    return Robot(
        name="toy",
        path=Path("toy.toml"),
        model=mujoco.MjModel.from_xml_string(_MJCF),
        joint_names=("left_hip", "right_hip", "shoulder"),
        body_names=("torso", "left_leg", "right_leg", "arm", "hand"),
        position_lower=np.array([-2.0, -2.0, -1.5]),
        position_upper=np.array([2.0, 2.0, 1.5]),
        velocity_limit=np.array([20.0, 20.0, 10.0]),
        acceleration_limit=500.0 * ones,
        effort_limit=ones,
        stiffness=ones,
        damping=ones,
        nominal=standing(1)[0],
        anchor_body="torso",
        key_bodies=tuple(KeyBody(name) for name in ("torso", "left_leg", "right_leg", "arm", "hand")),
        soles=tuple(Sole(side, f"{side}_leg", _POINTS, parts, _OUTLINE) for side in ("left", "right")),
        capsules=capsules,
        collision_pairs=((0, 3), (1, 2)),
    )


def standing(frames: int) -> np.ndarray:
    """Configurations of standing still.  # (T, 10)"""
    qpos = np.zeros((frames, 10))
    qpos[:, 2], qpos[:, 3] = 1.0, 1.0
    return qpos


def clip(qpos: np.ndarray, fps: float = FPS) -> RobotMotion:
    """A motion of the toy."""
    return RobotMotion(qpos, fps, ("left_hip", "right_hip", "shoulder"), "toy")


def both_feet(frames: int, fps: float = FPS, height: float = 0.0) -> ContactSchedule:
    """Every point of both soles on the floor throughout."""
    parts = ("toe", "toe", "heel", "heel")
    stances = [Stance(side, k, parts[k], 0, frames) for side in ("left", "right") for k in range(4)]
    return ContactSchedule(frames, fps, tuple(stances), height)


def _capsule(name: str, body: str, start: float, end: float, radius: float) -> Capsule:
    return Capsule(name, body, np.array([0.0, 0.0, start]), np.array([0.0, 0.0, end]), radius)
