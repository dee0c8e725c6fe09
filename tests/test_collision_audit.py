from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import fcl
import mujoco
import numpy as np
import pytest

from gmr_traj.collision.audit import ACCURACY, audit
from gmr_traj.collision.broadphase import candidates
from gmr_traj.collision.fcl_shapes import capsule_shape, geom_shapes
from gmr_traj.exceptions import RobotError
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Capsule, Robot

MESH = " ".join(f"{x:.6f}" for x in (np.random.default_rng(0).normal(size=(30, 3)) * 0.05).ravel())
KINDS = {
    "sphere": 'size="0.05"',
    "capsule": 'size="0.04 0.08"',
    "box": 'size="0.05 0.03 0.08"',
    "cylinder": 'size="0.05 0.07"',
    "ellipsoid": 'size="0.05 0.03 0.08"',
    "mesh": 'mesh="hull"',
}


def free_bodies(geoms: dict[str, str]) -> mujoco.MjModel:
    bodies = "".join(f'<body name="b_{n}"><freejoint/><geom name="{n}" {text}/></body>' for n, text in geoms.items())
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="hull" vertex="{MESH}"/></asset><worldbody>{bodies}</worldbody></mujoco>'
    )


@pytest.mark.parametrize("first", KINDS)
@pytest.mark.parametrize("second", KINDS)
def test_shapes_agree_with_mujoco(first: str, second: str) -> None:
    """FCL on our shapes, MuJoCo on its geoms, apart and overlapping.

    Except a capsule well inside a box: there mj_geomDistance's depth is not the least one (with the box as a mesh it
    is, and agrees with FCL), so only the sign is compared.
    """
    model = free_bodies(
        {f"a_{first}": f'type="{first}" {KINDS[first]}', f"b_{second}": f'type="{second}" {KINDS[second]}'}
    )
    data = mujoco.MjData(model)
    shapes = geom_shapes(model)
    rng = np.random.default_rng(7)
    overlaps = 0
    for _ in range(12):
        quaternions = rng.normal(size=(2, 4))
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        data.qpos[:] = np.hstack([rng.uniform(-0.09, 0.09, (2, 3)), quaternions]).ravel()
        mujoco.mj_kinematics(model, data)
        expected = mujoco.mj_geomDistance(model, data, 0, 1, 1.0, np.zeros(6))
        objects = [
            fcl.CollisionObject(
                shape.geometry,
                fcl.Transform(
                    data.xmat[k].reshape(3, 3) @ shape.rotation,
                    data.xpos[k] + data.xmat[k].reshape(3, 3) @ shape.position,
                ),
            )
            for k, shape in enumerate(shapes, start=1)
        ]
        found = fcl.distance(*objects, fcl.DistanceRequest(enable_signed_distance=True))
        overlaps += expected < 0
        if {first, second} == {"capsule", "box"} and expected < 0:
            assert found < 0
        else:
            assert found == pytest.approx(expected, abs=ACCURACY)
    assert overlaps > 2


def test_placed_capsule() -> None:
    capsule = Capsule("c", "b", np.array([0.1, 0.0, 0.2]), np.array([0.1, 0.3, 0.6]), 0.05)
    shape = capsule_shape(capsule)
    half = 0.5 * shape.geometry.lz
    np.testing.assert_allclose(shape.position + half * shape.rotation[:, 2], capsule.end, atol=1e-12)
    np.testing.assert_allclose(shape.position - half * shape.rotation[:, 2], capsule.start, atol=1e-12)
    point = Capsule("c", "b", np.ones(3), np.ones(3), 0.05)
    assert capsule_shape(point).geometry.lz == 0.0


def test_shape_that_cannot_be_checked() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/></worldbody></mujoco>'
    )
    with pytest.raises(RobotError, match=r"'floor' is a plane.*use a sphere"):
        geom_shapes(model)


HINGED = """
<mujoco><worldbody><body name="trunk"><freejoint/>
  <geom name="{box}" type="box" size="0.1 0.1 0.3" contype="{trunk}" conaffinity="{trunk}"/>
  <body name="arm" pos="0.5 0 0"><joint name="swing" axis="0 0 1"/>
    <geom name="rod" type="cylinder" fromto="0 0 0 -0.3 0 0" size="0.02"/>
    <geom name="knob" type="sphere" pos="-0.3 0 0.1" size="0.03"/>
  </body></body></worldbody></mujoco>
"""


def hinged(g1: Robot, *, box: str = "box", trunk: int = 1) -> tuple[Robot, np.ndarray]:
    """A box with an arm that swings towards it: at 0 rad the rod's end is 0.1 m from the box, the knob's 0.07 m."""
    model = mujoco.MjModel.from_xml_string(HINGED.format(box=box, trunk=trunk))
    robot = replace(
        g1,
        model=model,
        joint_names=("swing",),
        body_names=("trunk", "arm"),
        nominal=np.r_[np.zeros(3), 1.0, np.zeros(3), np.pi],
        capsules=(
            Capsule("box", "trunk", np.array([0, 0, -0.3]), np.array([0, 0, 0.3]), 0.1 * np.sqrt(2)),
            Capsule("rod", "arm", np.zeros(3), np.array([-0.3, 0, 0]), 0.03),
            Capsule("knob", "arm", np.array([-0.3, 0, 0.1]), np.array([-0.3, 0, 0.1]), 0.03),
        ),
        collision_pairs=((0, 1), (0, 2)),
    )
    qpos = np.tile(robot.nominal, (3, 1))
    qpos[1, 7] = 0.0
    return robot, qpos


def test_looks_at_the_real_geometry(g1: Robot) -> None:
    """The capsule around the box is nowhere near exact; the audit's depth is."""
    robot, qpos = hinged(g1)
    assert audit(robot, qpos) == []
    for closer, names in ((0.11, ["rod"]), (0.09, ["knob"])):
        model = robot.model
        model.body_pos[2] = [0.5 - closer, 0, 0]
        found = audit(robot, qpos)
        expected = {"rod": closer - 0.1, "knob": closer - 0.07}
        expected = {name: depth for name, depth in expected.items() if depth > 0}
        assert [p.shapes[1] for p in found] == sorted(expected, key=lambda name: -expected[name])
        assert set(names) <= set(expected)
        for penetration in found:
            assert penetration.bodies == ("trunk", "arm")
            assert penetration.frames.tolist() == [1]
            assert penetration.frame == 1
            assert penetration.depth == pytest.approx(expected[penetration.shapes[1]], abs=ACCURACY)


@pytest.mark.parametrize(("box", "trunk"), [("unknown", 1), ("box", 0)])
def test_capsules_without_a_geom_of_their_name(g1: Robot, box: str, trunk: int) -> None:
    robot, qpos = hinged(g1, box=box, trunk=trunk)
    robot.model.body_pos[2] = [0.5 - 0.13, 0, 0]
    found = {p.shapes: p.depth for p in audit(robot, qpos)}
    if trunk:  # all geoms of the body stand in
        expected = {("unknown", "rod"): 0.03, ("unknown", "knob"): 0.06}
    else:  # there is none: the capsule itself
        radius = robot.capsules[0].radius
        expected = {("rod", "box"): radius - 0.07, ("knob", "box"): radius - 0.04}
    assert found == pytest.approx(expected, abs=ACCURACY)
    touching = replace(robot, nominal=qpos[1])  # neighbours by design, unless the pair was meant literally
    assert {p.shapes for p in audit(touching, qpos)} == (set() if trunk else set(found))


def test_agrees_with_the_closed_form_on_capsules(g1: Robot) -> None:
    rng = np.random.default_rng(11)
    qpos = np.tile(g1.nominal, (8, 1))
    qpos[:, 7:] = rng.uniform(g1.position_lower, g1.position_upper, (8, g1.dof))
    found = {frozenset(p.shapes): p for p in audit(g1, qpos)}
    close = {
        frozenset(g1.capsules[c].name for c in candidate.pair): candidate
        for candidate in candidates(g1, *placements(g1, qpos), 0.0)
    }
    assert len(found) > 3
    assert set(found) <= set(close)
    for names, candidate in close.items():
        depth = -float(candidate.clearance.min())
        if depth > 2 * ACCURACY:
            assert found[names].depth == pytest.approx(depth, abs=ACCURACY)
            assert found[names].frame == candidate.frames[int(np.argmin(candidate.clearance))]


def test_agrees_with_mujoco_on_a_retargeted_clip(g1: Robot, data_dir: Path) -> None:
    with np.load(data_dir / "gmr_reference" / "dance2_subject3_hand.npz") as file:
        qpos = file["qpos"]
    found = audit(g1, qpos)
    data = mujoco.MjData(g1.model)
    assert found == sorted(found, key=lambda p: -p.depth)
    for penetration in found:
        data.qpos[:] = qpos[penetration.frame]
        mujoco.mj_kinematics(g1.model, data)
        a, b = (g1.model.geom(name).id for name in penetration.shapes)
        depth = -mujoco.mj_geomDistance(g1.model, data, a, b, 1.0, np.zeros(6))
        assert penetration.depth == pytest.approx(depth, abs=ACCURACY)
