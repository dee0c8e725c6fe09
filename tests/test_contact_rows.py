"""The wrench's rows as constraints: their derivatives, the cost they agree with, both engines, what cannot be kept."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from metrics_toy import FPS, both_feet, clip, standing
from optimiser_setup import (
    EXAMPLE,
    TIGHT,
    compare_numbers_with_symbols,
    context_of,
    jacobian_error,
    kinematics_of,
    residuals_of,
    toy,
    values,
)

from gmr_traj.attempts import Attempt
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.contacts.schedule import ContactSchedule, Stance
from gmr_traj.engines import solve
from gmr_traj.formulation import Formulation, formulate
from gmr_traj.motion import RobotMotion
from gmr_traj.outcome import TermReport
from gmr_traj.problem import load_problem
from gmr_traj.residuals import FrameResidual, Used, exceedance
from gmr_traj.robot import Robot
from gmr_traj.task import Task
from gmr_traj.terms.contact_rows import ContactRows
from gmr_traj.terms.contact_wrench import ContactWrench
from gmr_traj.terms.smoothness import Jerk
from gmr_traj.terms.tracking import Tracking
from gmr_traj.unkept import unkept
from gmr_traj.whole_clip import TOLERANCE, solve_clip

FIELDS = {
    "force": 0.05,
    "moment": 0.05,
    "torque": 0.02,
    "robust": 3.0,
    "friction": 0.7,
    "margin": 0.01,
    "effort": 0.75,
}
ROWS = ContactRows(**FIELDS)
TRACKING = Tracking(position=0.03, orientation=0.1, robust=0.05, source_weight=1.0)
JERK = Jerk(base_position=60.0, base_rotation=250.0, joints=350.0)
_STRICT = {"tol": 1e-6, "constr_viol_tol": 1e-8, "compl_inf_tol": 1e-8, "acceptable_obj_change_tol": 1e-16}
BAND = Attempt("band", {**_STRICT, "max_iter": 80}, "band")


@lru_cache
def strong() -> Robot:
    """The toy with legs that can carry it."""
    return replace(toy(), effort_limit=np.full(3, 400.0))


def swaying(frames: int, lean: float = 0.4) -> RobotMotion:
    """The toy sways, so fast that the zero-moment point leaves its feet."""
    qpos = standing(frames)
    qpos[:, 0] = 0.05 * np.sin(2 * np.pi * np.arange(frames) / 20)
    qpos[:, 9] = lean * np.sin(2 * np.pi * np.arange(frames) / 15)
    return clip(qpos)


def left_foot(frames: int) -> ContactSchedule:
    stances = (stance for stance in both_feet(frames).stances if stance.sole == "left")
    return ContactSchedule(frames, FPS, tuple(stances))


def rows_of(motion: RobotMotion, robot: Robot, schedule: ContactSchedule) -> list[FrameResidual]:
    found, _ = residuals_of(ROWS, context_of(robot, motion, schedule=schedule))
    out = [residual for residual in found if isinstance(residual, FrameResidual)]
    assert len(out) == len(found)
    return out


@pytest.mark.parametrize("feet", ["both", "left", "none"])
def test_jacobians_are_the_derivatives(feet: str) -> None:
    motion, robot = swaying(5), strong()
    schedule = {"both": both_feet(5), "left": left_foot(5), "none": ContactSchedule(5, FPS, ())}[feet]
    found = rows_of(motion, robot, schedule)
    names = {residual.name.partition("/")[2] for residual in found}
    assert (
        names
        == {
            "both": {"force", "zero-moment point"},
            "left": {"force", "zero-moment point", "torques over left"},
            "none": {"force in flight", "moment in flight"},
        }[feet]
    )
    x = 0.01 * np.random.default_rng(2).normal(size=5 * 9)
    for residual in found:
        assert residual.unit == ("m g" if "force" in residual.name else "m g m")
        assert jacobian_error(residual, x) < 1e-5 / residual.scale


@pytest.mark.parametrize("feet", ["left", "none"])
def test_what_they_are_off_by_is_what_the_cost_is_about(g1: Robot, feet: str) -> None:
    """Both are of the same rows: the cost is the sum of what each of them costs alone."""
    rng, frames = np.random.default_rng(4), 6
    qpos = np.tile(g1.nominal, (frames, 1))
    qpos[:, :3] += 0.01 * rng.normal(size=(frames, 3))
    qpos[:, 7:] += 0.03 * rng.normal(size=(frames, g1.dof))
    motion = RobotMotion(qpos, 30.0, g1.joint_names)
    sole = g1.soles[0]
    stances = [Stance(sole.name, k, part, 0, frames) for k, part in enumerate(sole.parts)] if feet == "left" else []
    context = context_of(g1, motion, schedule=ContactSchedule(frames, 30.0, tuple(stances)))
    (cost,), variables = residuals_of(ContactWrench(**FIELDS), context)
    assert isinstance(cost, FrameResidual) and cost.gauss_newton is not None
    x = variables.initial()
    expected = np.array(cost.gauss_newton.value.map(frames - 2)(x[cost.columns].T, cost.parameters)).ravel()
    total, robust = np.zeros(frames - 2), FIELDS["robust"]
    for residual in rows_of(motion, g1, context.schedule):
        off = exceedance(values(residual, x), residual.lower, residual.upper)
        square = off**2 * residual.weights / context.dt
        share = robust**2 * (np.sqrt(1 + square / robust**2) - 1)
        np.add.at(total, residual.frames - 1, context.dt * share.sum(axis=0))
    np.testing.assert_allclose(total, expected, rtol=1e-9)
    assert expected.max() > 0.0


def test_rows_without_a_bound_are_not_in_the_program() -> None:
    frames = 12
    stances = tuple(s if s.sole == "left" else replace(s, start=4) for s in both_feet(frames).stances)
    context = context_of(strong(), swaying(frames), schedule=ContactSchedule(frames, FPS, tuple(sorted(stances))))
    found, variables = residuals_of(ROWS, context)
    constraints = formulate(variables, [Used(residual, "hard") for residual in found]).constraints
    assert (np.isfinite(constraints.lower) | np.isfinite(constraints.upper)).all()
    built = {block.residual.name: len(block.kept) for block in constraints.blocks}
    # Frames 1 to 4 are on the left foot alone, whose leg has one joint; of eight edges a hull could have it has four.
    assert built["contact_wrench/force"] == 50 and built["contact_wrench/torques over left"] == 4
    assert 40 <= built["contact_wrench/zero-moment point"] < 80


def program(use: str, frames: int = 16) -> Formulation:
    context = context_of(strong(), swaying(frames), schedule=both_feet(frames))
    costs: Sequence[tuple[str, object]] = (("cost", TRACKING), ("cost", JERK), (use, ROWS))
    variables, used = None, []
    for how, term in costs:
        found, known = residuals_of(term, context)  # type: ignore[arg-type]
        variables = variables or known
        used += [Used(residual, how) for residual in found]
    assert variables is not None
    return formulate(variables, used)


@pytest.mark.parametrize("use", ["hard", "soft"])
def test_numbers_are_those_of_the_symbols(use: str) -> None:
    """Rows, Jacobian and condensed matrix, with the rows' scale and the slacks' columns."""
    compare_numbers_with_symbols(program(use))


@pytest.mark.parametrize("use", ["hard", "soft"])
def test_both_engines_find_the_same_optimum(use: str) -> None:
    formulation = program(use)
    mine, theirs = solve(formulation, (BAND,)), solve(formulation, (TIGHT,))
    assert mine.status == theirs.status == "converged"
    assert mine.objective == pytest.approx(theirs.objective, rel=1e-5)


def solved(use: str, margin: float) -> tuple[RobotMotion, tuple[TermReport, ...], str, str]:
    """The toy on one foot, between two frames at either end that are held."""
    motion, robot, frames = swaying(12), strong(), 12
    base = load_problem("refine_hard")
    term = ContactRows(**{**FIELDS, "margin": margin})
    kept = [item for item in base.terms if item.name in ("tracking", "jerk")]
    wrench = next(item for item in base.terms if item.name == "contact_wrench")
    problem = replace(base, terms=(*kept, replace(wrench, term=term, use=use)), again=base.first)
    held = np.zeros(0, int) if margin < 0.1 else np.array([0, 1, frames - 2, frames - 1])
    task = Task(motion, motion, np.ones(frames), left_foot(frames), held)
    result, report = solve_clip(task, kinematics_of(robot), problem)
    return result, report.terms, report.status, report.message


def test_hard_rows_are_kept_and_soft_ones_give_way() -> None:
    """On one of two legs, 10 cm beside it: the robot has to lean."""
    before = {residual.name: residual for residual in rows_of(swaying(12), strong(), left_foot(12))}
    zero = before["contact_wrench/zero-moment point"]
    assert exceedance(values(zero, np.zeros(12 * 9)), zero.lower, zero.upper).max() > 0.05
    _, reports, status, message = solved("hard", 0.01)
    assert status != "not converged" and message == ""
    off = {report.name: report.violation for report in reports if report.use == "hard"}
    assert set(off) == set(before)
    assert max(off.values()) <= TOLERANCE["m g m"]
    _, reports, status, _ = solved("soft", 0.5)
    assert status != "not converged"
    (zero_moment,) = [report for report in reports if report.name == "contact_wrench/zero-moment point"]
    assert zero_moment.use == "soft" and zero_moment.rows == 40 and zero_moment.violation > 0.1


def test_what_cannot_be_kept_is_named() -> None:
    """No point is half a metre inside a foot: the floor can give nothing, and from rest to rest none can fall."""
    _, _, status, message = solved("hard", 0.5)
    assert status == "not converged"
    assert "hard constraints that are not kept: contact_wrench/" in message and ", frame " in message
    assert message.endswith("used as soft ones they would give way")


def test_the_worst_row_of_every_term_is_named() -> None:
    def report(name: str, use: str, violation: float, unit: str) -> TermReport:
        return TermReport(name, use, 4, 0.0, violation, unit, "edge 1, frame 7")

    kept = [report("a", "hard", 1e-3, "m g"), report("b", "soft", 9.0, "m g"), report("c", "cost", 9.0, "m")]
    assert unkept(kept, TOLERANCE) == ""
    found = (("d/x", 0.1), ("d/y", 0.3), ("e", 0.2), ("f", 0.4), ("d/z", 0.05))
    text = unkept([*kept, *(report(name, "hard", off, "m g") for name, off in found)], TOLERANCE)
    assert "f (edge 1, frame 7: off by 0.4 m g), d/y (" in text and text.index("d/y (") < text.index("e (")
    assert "d/x" not in text and "d/z" not in text


def test_the_users_path(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody punches on ice: exit code 4, the rows that are left, and no file of the output's name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    ice = 'base = "refine_hard"\nname = "ice"\n[[terms]]\ntype = "contact_wrench"\nfriction = 1e-4\neffort = 0.05\n'
    (tmp_path / "ice.toml").write_text(ice)
    assert main(["refine", "punch.npz", "--problem", "ice.toml", "--output", "ice.npz"]) == ExitCode.NOT_CONVERGED
    out = " ".join(capsys.readouterr().out.split())
    assert re.search(
        r"hard constraints that are not kept: .*contact_wrench/[\w -]+ \([\w +-]+, frame \d+: off by ", out
    )
    assert not (tmp_path / "ice.npz").exists() and (tmp_path / "ice.unconverged.npz").exists()
