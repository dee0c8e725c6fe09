"""The Unitree G1 against what others have published about it."""

from __future__ import annotations

import csv
import pickle
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from conftest import TEST_DATA, example_robot_file

from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.kinematics.pinocchio_model import to_configuration
from gmr_traj.robot import Capsule, Robot

LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
JOINTS = (
    *(f"{side}_{name}_joint" for side in ("left", "right") for name in LEG),
    *(f"waist_{name}_joint" for name in ("yaw", "roll", "pitch")),
    *(f"{side}_{name}_joint" for side in ("left", "right") for name in ARM),
)


def published_capsules() -> list[Capsule]:
    """The capsules and spheres that mjlab gives the G1."""
    text = (TEST_DATA / "g1_published_capsules.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))

    def point(row: dict[str, str], end: str) -> np.ndarray:
        return np.array([float(row[axis + end]) for axis in "xyz"])

    return [Capsule(r["name"], r["body"], point(r, "0"), point(r, "1"), float(r["radius"])) for r in rows]


def surface(capsule: Capsule, count: int, seed: int = 0) -> np.ndarray:
    """Points on the surface of a capsule, in its body's frame.  # (2 count, 3)"""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axis = capsule.end - capsule.start
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    caps = np.where((normals @ axis > 0)[:, None], capsule.end, capsule.start) + capsule.radius * normals
    across = normals - (normals @ axis)[:, None] * axis
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    side = capsule.start + rng.random((count, 1)) * (capsule.end - capsule.start) + capsule.radius * across
    return np.vstack([caps, side])


def outside(points: np.ndarray, start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Signed distance of points from a capsule [m]."""
    axis = end - start
    along = np.clip((points - start) @ axis / max(float(axis @ axis), 1e-30), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - along[:, None] * axis, axis=1) - radius)


def placed(robot: Robot, q: np.ndarray, capsule: Capsule) -> tuple[np.ndarray, np.ndarray]:
    """World positions of a capsule's ends."""
    positions, rotations = placements(robot, q[None])
    b = robot.body_names.index(capsule.body)
    return positions[0, b] + rotations[0, b] @ capsule.start, positions[0, b] + rotations[0, b] @ capsule.end


def segment_distance(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> float:
    """Distance of two segments [m] by alternating projection, which converges as the problem is convex."""
    x, y = (a[0] + a[1]) / 2, (b[0] + b[1]) / 2
    for _ in range(2000):
        for_x, for_y = x, y
        d = a[1] - a[0]
        x = a[0] + np.clip((y - a[0]) @ d / max(float(d @ d), 1e-30), 0, 1) * d
        d = b[1] - b[0]
        y = b[0] + np.clip((x - b[0]) @ d / max(float(d @ d), 1e-30), 0, 1) * d
        if np.abs(x - for_x).max() < 1e-12 and np.abs(y - for_y).max() < 1e-12:
            break
    return float(np.linalg.norm(x - y))


def test_joints_bodies_and_limits(g1: Robot) -> None:
    assert g1.joint_names == JOINTS
    assert g1.anchor_body == "torso_link"
    assert len(g1.body_names) == 30
    by_name = dict(zip(g1.joint_names, zip(g1.velocity_limit, g1.effort_limit, strict=True), strict=True))
    assert by_name["left_knee_joint"] == (20, 139)
    assert by_name["right_ankle_roll_joint"] == (37, 50)
    assert by_name["waist_yaw_joint"] == (32, 88)
    assert by_name["left_wrist_yaw_joint"] == (22, 5)


def test_gains_follow_from_the_armature(g1: Robot) -> None:
    """BeyondMimic's rule: natural frequency 10 Hz, damping ratio 2."""
    armature, omega = g1.model.dof_armature[6:], 2 * np.pi * 10
    assert g1.stiffness == pytest.approx(armature * omega**2, rel=1e-4)
    assert g1.damping == pytest.approx(4 * armature * omega, rel=1e-3)


def test_accelerations_are_within_reach_of_the_torques(g1: Robot) -> None:
    """Each is at most effort * (M^-1)_ii in the nominal posture, and well above what recorded motion needs."""
    data = mujoco.MjData(g1.model)
    data.qpos[:] = g1.nominal
    mujoco.mj_forward(g1.model, data)
    inverse = np.zeros((g1.model.nv, g1.model.nv))
    mujoco.mj_solveM(g1.model, data, inverse, np.eye(g1.model.nv))
    assert (g1.acceleration_limit <= g1.effort_limit * np.diag(inverse)[6:]).all()
    assert g1.acceleration_limit.min() >= 400


def test_stands_with_flat_soles_on_the_floor(g1: Robot) -> None:
    positions, rotations = placements(g1, g1.nominal[None])
    for sole in g1.soles:
        b = g1.body_names.index(sole.body)
        points = positions[0, b] + np.vstack([sole.points, sole.outline]) @ rotations[0, b].T
        assert np.abs(points[:, 2]).max() < 1e-12


def test_outline_is_convex_and_holds_the_contact_points(g1: Robot) -> None:
    for sole in g1.soles:
        corners = sole.outline[:, :2]
        assert (corners.min(axis=0), corners.max(axis=0)) == (
            pytest.approx([-0.066, -0.038]),
            pytest.approx([0.142, 0.038]),
        )
        edges = np.roll(corners, -1, axis=0) - corners
        left_of = edges[:, 0] * (np.roll(edges, -1, axis=0))[:, 1] - edges[:, 1] * (np.roll(edges, -1, axis=0))[:, 0]
        assert (left_of > 0).all()  # counter-clockwise, turning left at every corner
        for point in sole.points[:, :2]:
            offset = point - corners
            assert (edges[:, 0] * offset[:, 1] - edges[:, 1] * offset[:, 0] > 0).all()


def test_feet_have_few_capsules_that_end_at_the_sole(g1: Robot) -> None:
    for side in ("left", "right"):
        feet = [c for c in g1.capsules if c.body == f"{side}_ankle_roll_link"]
        assert 0 < len(feet) <= 5
        lowest = min(min(c.start[2], c.end[2]) - c.radius for c in feet)
        assert lowest == pytest.approx(-0.035, abs=1e-12)


def test_published_capsules_lie_inside_ours(g1: Robot) -> None:
    capsules = published_capsules()
    assert len(capsules) == 33
    for published in capsules:
        points = surface(published, 3000)
        ours = [outside(points, c.start, c.end, c.radius) for c in g1.capsules if c.body == published.body]
        assert np.min(ours, axis=0).max() < 1e-3, published.name


def test_pairs_cover_the_published_shapes_pairs(g1: Robot) -> None:
    """Where published shapes, more than two bodies apart, are 5 mm apart with all joints zero, ours must keep apart."""
    parent = {
        g1.model.body(b).name: g1.model.body(int(g1.model.body_parentid[b])).name for b in range(1, g1.model.nbody)
    }

    def near(a: str, b: str) -> bool:
        return a in (b, parent[b], parent.get(parent[b])) or b in (a, parent[a], parent.get(parent[a]))

    zero = np.array([0, 0, 1, 1, 0, 0, 0] + [0] * 29, dtype=float)
    ends = [(c, placed(g1, zero, c)) for c in published_capsules()]
    wanted = {
        frozenset((a.body, b.body))
        for i, (a, ends_a) in enumerate(ends)
        for b, ends_b in ends[i + 1 :]
        if not near(a.body, b.body) and segment_distance(ends_a, ends_b) - a.radius - b.radius > 0.005
    }
    assert len(wanted) > 50
    pairs = set(g1.collision_pairs)
    for i, a in enumerate(g1.capsules):
        for k in range(i + 1, len(g1.capsules)):
            if frozenset((a.body, g1.capsules[k].body)) in wanted:
                assert (i, k) in pairs, (a.name, g1.capsules[k].name)


def test_kinematics_and_masses_are_those_of_unitree_s_urdf(g1: Robot) -> None:
    spec = mujoco.MjSpec.from_file(str(example_robot_file("g1_29dof_rev_1_0.urdf")))
    for element in [*spec.geoms, *spec.meshes]:
        spec.delete(element)
    spec.worldbody.first_body().add_freejoint()
    urdf = spec.compile()
    assert [urdf.joint(j).name for j in range(1, urdf.njnt)] == list(g1.joint_names)
    assert np.allclose(urdf.jnt_range, g1.model.jnt_range, atol=1e-5)
    names = [name for name in g1.body_names if mujoco.mj_name2id(urdf, mujoco.mjtObj.mjOBJ_BODY, name) > 0]
    assert len(names) == 30
    rng = np.random.default_rng(0)
    data = mujoco.MjData(urdf)
    for _ in range(5):
        q = np.concatenate([[0, 0, 0, 1, 0, 0, 0], rng.uniform(g1.position_lower, g1.position_upper)])
        data.qpos[:] = q
        mujoco.mj_kinematics(urdf, data)
        positions, rotations = placements(g1, q[None])
        for name in names:
            b = g1.body_names.index(name)
            assert np.abs(data.body(name).xpos - positions[0, b]).max() < 1e-6
            assert np.abs(data.body(name).xmat - rotations[0, b].ravel()).max() < 2e-6
    for name in names:  # the URDF's massless sensor frames add a gram where they are fused
        assert urdf.body(name).mass == pytest.approx(g1.model.body(name).mass, abs=1.1e-3)
        assert urdf.body(name).ipos == pytest.approx(g1.model.body(name).ipos, abs=1e-4)


def test_shapes_cover_the_meshes(g1: Robot) -> None:
    """Unitree's meshes stick out of the union of all shapes by at most 22 mm, and 95 % of their vertices by 15 mm."""
    urdf = example_robot_file("g1_29dof_rev_1_0.urdf")
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    meshes = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.VISUAL, package_dirs=[str(urdf.parents[4])])
    assert len(meshes.geometryObjects) >= 30
    # Standing, and with a knee up, an arm raised and the waist turned, as in a dance.
    raised = g1.nominal.copy()
    for name, value in (
        ("left_hip_pitch", -1.2),
        ("left_knee", 1.4),
        ("right_shoulder_roll", -1.4),
        ("waist_yaw", 0.6),
    ):
        raised[7 + JOINTS.index(f"{name}_joint")] = value
    for q in (g1.nominal, raised):
        data, placed_meshes = model.createData(), meshes.createData()
        pin.updateGeometryPlacements(model, data, meshes, placed_meshes, to_configuration(q))
        ends = [(*placed(g1, q, c), c.radius) for c in g1.capsules]
        for mesh, T_world_mesh in zip(meshes.geometryObjects, placed_meshes.oMg, strict=True):
            vertices = np.asarray(mesh.geometry.vertices())[::5] * mesh.meshScale
            points = T_world_mesh.translation + vertices @ T_world_mesh.rotation.T
            gap = np.min([outside(points, *end) for end in ends], axis=0)
            assert gap.max() < 0.022, mesh.name
            assert np.quantile(gap, 0.95) < 0.015, mesh.name


def test_recorded_walks_collide_no_more_than_with_the_published_shapes(g1: Robot, data_dir: Path) -> None:
    published = published_capsules()
    apart = {frozenset((g1.capsules[i].body, g1.capsules[k].body)) for i, k in g1.collision_pairs}
    paths = sorted((data_dir / "gmr_pkl").glob("*.pkl"))
    assert paths, f"{data_dir / 'gmr_pkl'} holds no clips"
    for path in paths[:4]:
        clip = pickle.loads(path.read_bytes())  # files of the test set, which are trusted
        q = np.hstack([clip["root_pos"], np.roll(clip["root_rot"], 1, axis=1), clip["dof_pos"]])[::10]
        positions, rotations = placements(g1, q)
        depths = []
        for capsules in (published, list(g1.capsules)):
            b = [g1.body_names.index(c.body) for c in capsules]
            starts = positions[:, b] + np.einsum("tbij,bj->tbi", rotations[:, b], np.array([c.start for c in capsules]))
            ends = positions[:, b] + np.einsum("tbij,bj->tbi", rotations[:, b], np.array([c.end for c in capsules]))
            depths.append([_deepest(capsules, starts[t], ends[t], apart) for t in range(len(q))])
        new = (np.array(depths[1]) > 1e-3) & (np.array(depths[0]) <= 1e-3)
        assert not new.any(), f"{path.name}: sampled frames {np.flatnonzero(new)}"


def _deepest(capsules: list[Capsule], starts: np.ndarray, ends: np.ndarray, apart: set[frozenset[str]]) -> float:
    deepest = 0.0
    centre, reach = (starts + ends) / 2, np.linalg.norm(ends - starts, axis=1) / 2 + [c.radius for c in capsules]
    for i, a in enumerate(capsules):
        for k in range(i + 1, len(capsules)):
            b = capsules[k]
            far = np.linalg.norm(centre[i] - centre[k]) > reach[i] + reach[k]
            if far or frozenset((a.body, b.body)) not in apart:
                continue
            gap = segment_distance((starts[i], ends[i]), (starts[k], ends[k])) - a.radius - b.radius
            deepest = max(deepest, -gap)
    return deepest
