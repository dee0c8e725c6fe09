"""Which of two problems counts: the one that was asked for, unless it breaks a promise that the other one keeps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gmr_traj.cli import refine_otherwise
from gmr_traj.cli.refine_otherwise import settle
from gmr_traj.exceptions import ResourceError
from gmr_traj.formats import Clip
from gmr_traj.motion import RobotMotion
from gmr_traj.problem import load_problem

PROBLEM = load_problem("refine")


def settled(monkeypatch: pytest.MonkeyPatch, g1: Any, first: str, second: str) -> tuple[Any, list[str]]:
    """Settle with the outcomes ``kept``, ``broken``, ``worse`` or ``lost`` of either problem; and which were solved."""
    solved: list[str] = []
    outcomes = {"refine": first, "refine_kinematic": second}
    motion = RobotMotion(np.tile(g1.nominal, (4, 1)), 30.0, g1.joint_names)

    def solve(problem: Any) -> Any:
        solved.append(problem.name)
        status = "not converged" if outcomes[problem.name] == "lost" else "converged"
        report = SimpleNamespace(status=status, message="the solver stopped with Maximum_Iterations_Exceeded")
        own = motion.with_qpos(motion.qpos + np.eye(1, motion.qpos.shape[1]) * len(solved))
        return SimpleNamespace(name=problem.name, motion=own, schedule=SimpleNamespace(height=0.0), report=report)

    def certify(*_: Any, **__: Any) -> Any:
        broken = {"kept": 0, "broken": 1, "worse": 2, "lost": 1}[outcomes[solved[-1]]]
        return SimpleNamespace(held=broken == 0, broken=(SimpleNamespace(name="self_depth"),) * broken)

    monkeypatch.setattr(refine_otherwise, "certify", certify)
    clip = Clip(motion=motion, format="gmr-traj")
    return settle(clip, g1, PROBLEM, solve), solved


@pytest.mark.parametrize(
    ("first", "second", "taken"),
    [
        ("kept", "kept", "refine"),
        ("broken", "kept", "refine_kinematic"),
        ("broken", "broken", "refine"),
        ("broken", "worse", "refine"),
        ("worse", "broken", "refine_kinematic"),
        ("broken", "lost", "refine"),
        ("lost", "kept", "refine_kinematic"),
        ("lost", "broken", "refine_kinematic"),
        ("lost", "lost", "refine"),
    ],
)
def test_which_one_counts(monkeypatch, g1, first: str, second: str, taken: str) -> None:
    found, solved = settled(monkeypatch, g1, first, second)
    assert found.problem == found.refinement.name == taken
    assert solved == (["refine"] if first == "kept" else ["refine", "refine_kinematic"])
    assert bool(found.note) is (taken != "refine")
    if found.note:
        assert ("self_depth" if first in ("broken", "worse") else "Maximum_Iterations_Exceeded") in found.note


def test_a_certificate_is_of_the_same_motion_alone(monkeypatch, g1) -> None:
    found, _ = settled(monkeypatch, g1, "broken", "kept")
    motion = found.refinement.motion
    assert found.certificate_of(motion.with_qpos(motion.qpos.copy())) is found.certificate is not None
    rounded = motion.qpos.copy()
    rounded[1, 10] = np.nextafter(rounded[1, 10], 9.0)
    assert found.certificate_of(motion.with_qpos(rounded)) is None
    assert found.certificate_of(replace(motion, fps=50.0)) is None


def test_without_another_problem_nothing_is_measured(monkeypatch, g1) -> None:
    monkeypatch.setattr(refine_otherwise, "certify", lambda *_, **__: pytest.fail("measured for nothing"))
    motion = RobotMotion(np.tile(g1.nominal, (4, 1)), 30.0, g1.joint_names)
    found = settle(Clip(motion=motion, format="gmr-traj"), g1, replace(PROBLEM, otherwise=None), lambda _: motion)
    assert found.certificate is None and found.problem == "refine"


def test_another_problem_that_does_not_exist_is_named(monkeypatch, g1) -> None:
    motion = RobotMotion(np.tile(g1.nominal, (4, 1)), 30.0, g1.joint_names)
    lost = SimpleNamespace(motion=motion, schedule=None, report=SimpleNamespace(status="not converged"))
    monkeypatch.setattr(refine_otherwise, "_certificate", lambda *_: SimpleNamespace(held=False, broken=()))
    with pytest.raises(ResourceError, match="peace"):
        settle(Clip(motion=motion, format="gmr-traj"), g1, replace(PROBLEM, otherwise="peace"), lambda _: lost)
