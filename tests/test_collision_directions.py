from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gmr_traj.collision.broadphase import Candidate, candidates
from gmr_traj.collision.capsules import radii, world_segments
from gmr_traj.collision.directions import DirectedCandidate, separating_directions
from gmr_traj.collision.segments import directed_distance, distance, normal
from gmr_traj.collision.segments_casadi import directed_rows
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Capsule, Robot

ARM, TRUNK = 0.035, 0.09
REACH = ARM + TRUNK
IN_AND_BACK = [0.3, 0.2, 0.12, 0.08, 0.03, -0.02, -0.06, -0.06, 0.01, 0.05, 0.1, 0.2, 0.3]


@pytest.fixture
def toy(g1: Robot) -> Robot:
    """An upright trunk and a level arm across it, on two free bodies."""
    arm = Capsule("arm", "arm", np.array([0, -0.15, 0.25]), np.array([0, 0.15, 0.25]), ARM)
    trunk = Capsule("trunk", "base", np.zeros(3), np.array([0, 0, 0.3]), TRUNK)
    return replace(g1, body_names=("base", "arm"), capsules=(arm, trunk), collision_pairs=((0, 1),))


def poses(forward: list[float]) -> tuple[np.ndarray, np.ndarray]:
    positions = np.zeros((len(forward), 2, 3))
    positions[:, 1, 0] = forward
    return positions, np.broadcast_to(np.eye(3), (len(forward), 2, 3, 3)).copy()


def directed(robot: Robot, positions: np.ndarray, rotations: np.ndarray) -> DirectedCandidate:
    (one,) = separating_directions(robot, positions, rotations, candidates(robot, positions, rotations, 0.0))
    np.testing.assert_allclose(np.linalg.norm(one.normals, axis=1), 1.0)
    assert (one.directed <= one.clearance + 1e-12).all()
    np.testing.assert_allclose(one.directed[~one.held], one.clearance[~one.held], atol=1e-12)
    return one


def test_pushed_out_on_the_side_it_came_in_by(toy: Robot) -> None:
    at = poses(IN_AND_BACK)
    starts, ends = world_segments(toy, *at)
    own = normal(starts[:, 0], ends[:, 0], starts[:, 1], ends[:, 1])
    assert own[6, 0] == pytest.approx(-1.0)  # the frame alone would push out of the far side
    one = directed(toy, *at)
    assert one.frames.tolist() == list(range(2, 11))
    np.testing.assert_allclose(one.normals, [[1, 0, 0]] * 9, atol=1e-12)
    np.testing.assert_allclose(one.directed, np.array(IN_AND_BACK)[2:11] - REACH, atol=1e-12)
    assert one.held.tolist() == [x < 0.03 + 1e-9 for x in IN_AND_BACK[2:11]]


def test_a_shallow_overlap_keeps_its_own_normals(toy: Robot) -> None:
    one = directed(toy, *poses([0.2, 0.12, 0.1, 0.08, 0.1, 0.13]))
    assert not one.held.any()
    assert one.frames.tolist() == [1, 2, 3, 4]


def test_a_short_visit_to_the_far_side_is_taken_back(toy: Robot) -> None:
    forward = [0.3, 0.1, -0.03, -0.2, -0.2, -0.03, 0.1, 0.3]
    one = directed(toy, *poses(forward))
    assert one.frames.tolist() == list(range(1, 7))  # the frames of the visit too, though they are clear
    np.testing.assert_allclose(one.normals, [[1, 0, 0]] * 6, atol=1e-12)
    long_visit = [*forward[:3], *[-0.2] * 8, *forward[5:]]
    one = directed(toy, *poses(long_visit))
    assert 6 not in one.frames


def test_passing_through_goes_round_the_shorter_way(toy: Robot) -> None:
    one = directed(toy, *poses([0.3, 0.1, 0.06, 0.02, -0.02, -0.06, -0.1, -0.3]))
    held = one.normals[one.held]
    np.testing.assert_allclose(one.normals[0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(one.normals[-1], [-1, 0, 0], atol=1e-12)
    assert (held[:, 2] > 0.5).any()  # the trunk ends 5 cm above the arm, and the arm reaches 15 cm to either side
    np.testing.assert_allclose(one.normals[:, 1], 0.0, atol=1e-12)
    assert (np.diff(one.normals[:, 0]) <= 1e-12).all()


@pytest.mark.parametrize(
    ("forward", "side"), [([0.01, 0.02, 0.06, 0.2], 1), ([-0.2, -0.06, -0.01], -1), ([0.01, -0.02, 0.005], -1)]
)
def test_overlap_at_the_ends_of_the_clip(toy: Robot, forward: list[float], side: int) -> None:
    one = directed(toy, *poses(forward))
    np.testing.assert_allclose(one.normals, [[side, 0, 0]] * len(one.frames), atol=1e-12)


def test_turns_with_the_robot(toy: Robot) -> None:
    positions, rotations = poses(IN_AND_BACK)
    turn = Rotation.from_rotvec(np.linspace(0, 3, len(positions))[:, None] * [0.1, 0.2, 1.0]).as_matrix()
    shift = np.linspace([0, 0, 0], [1, 2, 0.3], len(positions))
    still = directed(toy, positions, rotations)
    moved = directed(toy, np.einsum("tij,tbj->tbi", turn, positions) + shift[:, None], turn[:, None] @ rotations)
    np.testing.assert_allclose(moved.normals, np.einsum("tij,tj->ti", turn[moved.frames], still.normals), atol=1e-9)
    np.testing.assert_allclose(moved.directed, still.directed, atol=1e-9)


def test_a_whole_clip_problem_leaves_on_the_near_side(toy: Robot) -> None:
    """Stay close to the clip and smooth, keep the rows: the arm stays in front of the trunk all the time."""
    positions, rotations = poses(IN_AND_BACK)
    one = directed(toy, positions, rotations)
    starts, ends = world_segments(toy, positions, rotations)
    x = ca.SX.sym("x", 3, len(positions))
    rows = []
    for t, n in zip(one.frames, one.normals, strict=True):
        a0, a1, b0, b1 = (ca.DM(p[t, k]) for k in (0, 1) for p in (starts, ends))
        rows.append(directed_rows(ca.DM(n), a0 + x[:, int(t)], a1 + x[:, int(t)], ARM, b0, b1, TRUNK))
    moved = x + ca.DM(positions[:, 1].T)
    bend = moved[:, 2:] - 2 * moved[:, 1:-1] + moved[:, :-2]
    problem = {"x": ca.vec(x), "f": ca.sumsqr(x) + ca.sumsqr(bend), "g": ca.vertcat(*rows)}
    solver = ca.nlpsol("apart", "ipopt", problem, {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"})
    solution = solver(x0=0, lbg=0, ubg=ca.inf)
    assert solver.stats()["success"]
    shift = np.array(solution["x"]).reshape(-1, 3)
    clear, _, _ = distance(starts[:, 0] + shift, ends[:, 0] + shift, starts[:, 1], ends[:, 1])
    assert clear.min() >= REACH - 1e-6
    assert (positions[:, 1, 0] + shift[:, 0]).min() >= REACH - 1e-6


def test_retargeted_dance(g1: Robot, data_dir: Path) -> None:
    """On a real clip the directions are bounds, exact wherever the frame's own normal was kept."""
    with np.load(data_dir / "gmr_reference" / "dance2_subject3_hand.npz") as file:
        positions, rotations = placements(g1, file["qpos"])
    close = candidates(g1, positions, rotations, 0.02)
    starts, ends = world_segments(g1, positions, rotations)
    reach = radii(g1)
    found = separating_directions(g1, positions, rotations, close)
    assert [one.pair for one in found] == [c.pair for c in close]
    assert 0 < sum(one.held.sum() for one in found) < sum((one.clearance < 0).sum() for one in found) / 4
    for one, candidate in zip(found, close, strict=True):
        i, j = one.pair
        assert set(candidate.frames.tolist()) <= set(one.frames.tolist())
        points = (starts[one.frames, i], ends[one.frames, i], starts[one.frames, j], ends[one.frames, j])
        np.testing.assert_allclose(directed_distance(one.normals, *points) - reach[i] - reach[j], one.directed)
        assert (one.directed <= one.clearance + 1e-9).all()
        np.testing.assert_allclose(one.directed[~one.held], one.clearance[~one.held], atol=1e-9)


def test_no_candidates(toy: Robot) -> None:
    assert separating_directions(toy, *poses([0.5, 0.5]), []) == []
    far = Candidate((0, 1), np.array([1]), np.array([0.375]))
    (one,) = separating_directions(toy, *poses([0.5, 0.5]), [far])
    assert one.frames.tolist() == [1]
