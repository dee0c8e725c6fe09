"""Small robots written to files, for the tests of reading robots."""

from __future__ import annotations

from pathlib import Path

# A biped of boxes: two legs with a hip and an ankle each, soles 5 cm below the ankles.
MJCF = """<mujoco model="toy">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="base" pos="0 0 1">
      <freejoint/>
      <geom name="trunk" type="box" size="0.1 0.2 0.1"/>
      <body name="left_thigh" pos="0 0.1 -0.2">
        <joint name="left_hip" type="hinge" axis="0 1 0" range="-1 1"/>
        <geom name="left_thigh" type="capsule" fromto="0 0 -0.05 0 0 -0.3" size="0.04"/>
        <body name="left_foot" pos="0 0 -0.4">
          <joint name="left_ankle" type="hinge" axis="0 1 0" range="-1 1"/>
          <geom name="left_foot" type="capsule" fromto="-0.05 0 -0.02 0.1 0 -0.02" size="0.03"/>
        </body>
      </body>
      <body name="right_thigh" pos="0 -0.1 -0.2">
        <joint name="right_hip" type="hinge" axis="0 1 0" range="-1 1"/>
        <geom name="right_thigh" type="capsule" fromto="0 0 -0.05 0 0 -0.3" size="0.04"/>
        <body name="right_foot" pos="0 0 -0.4">
          <joint name="right_ankle" type="hinge" axis="0 1 0" range="-1 1"/>
          <geom name="right_foot" type="capsule" fromto="-0.05 0 -0.02 0.1 0 -0.02" size="0.03"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="left_hip"/>
  </actuator>
  <keyframe>
    <key name="home" qpos="0 0 1 1 0 0 0 0 0 0 0"/>
  </keyframe>
</mujoco>
"""

TOML = """name = "toy"
model = "toy.xml"
anchor_body = "base"

[[joints]]
names = ["*_hip", "*_ankle"]
velocity = 10.0
acceleration = 100.0
effort = 50.0
stiffness = 40.0
damping = 2.0

[nominal]
"*_hip" = -0.2
"*_ankle" = 0.2

[[key_bodies]]
bodies = ["base", "*_foot"]
position_weight = 2.0

[[soles]]
name = "left"
body = "left_foot"
toe = [[0.1, 0.02, -0.05], [0.1, -0.02, -0.05]]
heel = [[-0.05, 0.02, -0.05], [-0.05, -0.02, -0.05]]

[[soles]]
name = "right"
body = "right_foot"
toe = [[0.1, 0.02, -0.05], [0.1, -0.02, -0.05]]
heel = [[-0.05, 0.02, -0.05], [-0.05, -0.02, -0.05]]

[collision]
ignore_within_joints = 1
"""


def write_robot(folder: Path, toml: str = TOML, model: str = MJCF, name: str = "toy.xml") -> Path:
    """Write a robot.toml and its model into a folder; returns the robot.toml."""
    (folder / name).write_text(model, encoding="utf-8")
    path = folder / "robot.toml"
    path.write_text(toml, encoding="utf-8")
    return path
