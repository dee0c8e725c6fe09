"""Hands and knees in the problem: rows, derivatives, the hull they span, and clips that get up from nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from limb_clips import FPS, HANDS, KNEES, on_all_fours
from optimiser_setup import EXAMPLE, context_of, jacobian_error, residuals_of, values
from scipy.spatial import ConvexHull

from gmr_traj.cli.main import main
from gmr_traj.contacts.detect import detect
from gmr_traj.contacts.limbs import limb_points
from gmr_traj.contacts.mask import limbs_to_mask
from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.contacts.support import thinned
from gmr_traj.formats import Clip, read_clip, write_clip
from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.metrics.observation import observe
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem
from gmr_traj.refine import refine
from gmr_traj.residuals import FrameResidual
from gmr_traj.robot import Robot
from gmr_traj.runs import runs
from gmr_traj.terms.contact_wrench import ContactWrench
from gmr_traj.terms.stance import StanceAnchor
from gmr_traj.terms.steep_feet import overhang
from gmr_traj.verify.physics_change import physics_change

ANCHOR = StanceAnchor(horizontal=0.001, vertical=0.001, limb=0.004)
WRENCH = ContactWrench(force=0.05, moment=0.05, torque=0.02, robust=3.0, friction=0.7, margin=0.01, effort=0.75)


@pytest.fixture(scope="module")
def crawling(g1: Robot) -> RobotMotion:
    return on_all_fours(g1, 20, step=False)


def only(schedule: ContactSchedule, names: tuple[str, ...]) -> ContactSchedule:
    return replace(schedule, stances=tuple(s for s in schedule.stances if s.sole in names))


def test_rows_are_centres_less_anchors_at_their_radius(g1: Robot, crawling: RobotMotion) -> None:
    schedule = detect(crawling, g1)
    context = context_of(g1, crawling, schedule=schedule)
    found, variables = residuals_of(ANCHOR, context)
    assert {residual.name for residual in found} == {f"stance/{name}" for name in HANDS + KNEES}
    assert variables.size == crawling.frames * (6 + g1.dof) + 2 * len(schedule.stances)
    x = variables.initial()
    for residual in found:
        assert isinstance(residual, FrameResidual)
        held = residual.weights > 0
        assert np.abs(values(residual, x)[held]).max() < 1e-3  # the clip is planted already
        assert residual.weights.max() == pytest.approx(context.dt / 0.004**2)
        assert jacobian_error(residual, x + 0.01 * np.random.default_rng(0).normal(size=len(x))) < 1e-6
    # Without a scale they are not held at all.
    assert residuals_of(replace(ANCHOR, limb=0.0), context)[0] == []


def missing(motion: RobotMotion, robot: Robot, schedule: ContactSchedule) -> np.ndarray:
    """What the wrench of inner frames costs."""
    (residual,), variables = residuals_of(WRENCH, context_of(robot, motion, schedule=schedule))
    assert isinstance(residual, FrameResidual) and residual.gauss_newton is not None
    x, count = variables.initial(), len(residual.frames)
    value = residual.gauss_newton.value.map(count)
    return np.array(value(x[residual.columns].T, residual.parameters)).ravel()[1:-1] * FPS


def test_hands_and_knees_bear_the_robot_and_knees_alone_do_not(g1: Robot, crawling: RobotMotion) -> None:
    schedule = detect(crawling, g1)
    np.testing.assert_allclose(missing(crawling, g1, schedule), 0.0, atol=1e-9)
    # Hands lifted out of reach: the centre of mass is ahead of the knees, which would have to bear it.
    lifted = crawling.qpos.copy()
    for side in ("left", "right"):
        lifted[:, 7 + g1.joint_names.index(f"{side}_shoulder_pitch_joint")] -= 0.8
    raised = crawling.with_qpos(lifted)
    assert missing(raised, g1, only(schedule, KNEES)).min() > 0.1


def test_a_limb_on_the_floor_that_is_not_in_stance_is_not_explained(g1: Robot, crawling: RobotMotion) -> None:
    schedule = detect(crawling, g1)
    np.testing.assert_array_equal(missing(crawling, g1, only(schedule, KNEES)), 0.0)


def test_a_foot_is_as_steep_as_the_clip_has_it_while_a_limb_stands(g1: Robot, crawling: RobotMotion) -> None:
    limbs, seen, sole = detect(crawling, g1), observe(crawling, g1), g1.soles[0]
    context = context_of(g1, crawling, schedule=limbs)
    toes = np.tile([part == "toe" for part in sole.parts], (crawling.frames, 1))
    names = [capsule.body == sole.body for capsule in g1.capsules]
    expected = seen.soles[0][..., 2] - seen.lowest[:, names].min(axis=1, keepdims=True)
    assert expected.min() > 0.02  # the soles face away from the floor
    np.testing.assert_allclose(overhang(context, sole, sole.points, toes), expected, atol=1e-12)
    assert not overhang(context, sole, sole.points, toes | True).any()  # its heel stands, too
    none = context_of(g1, crawling, schedule=replace(limbs, stances=()))
    assert not overhang(none, sole, sole.points, toes).any()


@given(st.integers(1, 20), st.integers(3, 8), st.integers(0, 2**32 - 1))
def test_a_thinned_hull_is_inside_the_hull(count: int, most: int, seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 2))
    kept = thinned(points, most)
    if count <= most:
        assert kept is points
        return
    assert len(kept) <= most
    assert all((points == corner).all(axis=1).any() for corner in kept)
    assert len(ConvexHull(kept).vertices) == len(kept)  # each is a corner still
    corners = points[ConvexHull(points).vertices]
    if len(corners) == most + 1:
        left = [ConvexHull(np.delete(corners, k, axis=0)).volume for k in range(len(corners))]
        assert ConvexHull(kept).volume == pytest.approx(max(left))


def drifts(motion: RobotMotion, robot: Robot, schedule: ContactSchedule) -> np.ndarray:
    """How far each ball strays from where its stance begins [m]."""
    centres, on = limb_points(robot, placements(robot, motion.qpos))[0], limbs_to_mask(schedule, robot)
    spans = [(k, *run) for k in range(on.shape[1]) for run in runs(on[:, k])]
    paths = [centres[start:stop, k, :2] for k, start, stop in spans]
    return np.array([np.linalg.norm(path - path[0], axis=1).max() for path in paths])


def test_a_robot_on_all_fours_is_planted_and_can_be_followed(g1: Robot) -> None:
    motion = on_all_fours(g1, 90, np.random.default_rng(2))
    result = refine(motion, g1, load_problem("refine"))
    assert result.report.status in ("converged", "acceptable")
    was, now = (drifts(m, g1, result.schedule) for m in (motion, result.motion))
    assert was.max() > 0.02 and now.max() < 0.005
    centres, radii = limb_points(g1, placements(g1, result.motion.qpos))
    assert (centres[..., 2] - radii).min() > -0.001
    physics = physics_change(motion, result.motion, g1, result.schedule.height).to_json()
    assert physics["before"]["infeasible_share"] > 0.3
    assert physics["after"]["infeasible_share"] < 0.05


def test_the_command_on_all_fours(g1: Robot, tmp_path: Path) -> None:
    clip, contacts, again = (tmp_path / name for name in ("fours.npz", "contacts.json", "again.npz"))
    write_clip(Clip(on_all_fours(g1, 60, np.random.default_rng(3)), "gmr-traj"), clip, robot=g1)
    out = tmp_path / "out.npz"
    options = ["--quiet", "--output"]
    assert main(["refine", str(clip), *options, str(out), "--save-contacts", str(contacts)]) == 0
    names = {stance.get("support") for stance in json.loads(contacts.read_text())["stances"]}
    assert set(HANDS + KNEES) <= names
    assert main(["refine", str(clip), *options, str(again), "--contacts", str(contacts)]) == 0
    np.testing.assert_array_equal(read_clip(out, g1).motion.qpos, read_clip(again, g1).motion.qpos)


@pytest.mark.slow
def test_a_clip_on_two_feet_is_refined_as_before(g1: Robot) -> None:
    motion = read_clip(EXAMPLE, g1).motion
    one, other = (refine(motion, r, load_problem("refine")).motion for r in (g1, replace(g1, supports=())))
    np.testing.assert_array_equal(one.qpos, other.qpos)
