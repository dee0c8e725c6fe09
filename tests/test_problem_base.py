"""Problem files that rest on another one: what is taken, changed, left out, and what is said of mistakes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gmr_traj.exceptions import ProblemError, ResourceError
from gmr_traj.problem import load_problem
from gmr_traj.problem_base import problem_files
from gmr_traj.terms.stance import StanceAnchor

HEAD = 'base = "refine"\nname = "mine"\n'


def write(folder: Path, text: str, name: str = "mine.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_all_but_the_name_is_the_base_s(tmp_path: Path) -> None:
    mine, base = load_problem(write(tmp_path, HEAD)), load_problem("refine")
    assert mine.name == "mine"
    assert (mine.terms, mine.passes, mine.first, mine.again) == (base.terms, base.passes, base.first, base.again)


def test_terms_are_changed_left_out_and_added(tmp_path: Path) -> None:
    text = (
        HEAD
        + """passes = 2
without = ["contact_wrench", "posture"]
[[terms]]
type = "jerk"
joints = 123.0
[[terms]]
type = "velocity"
use = "cost"
base_position = 1.0
base_rotation = 2.0
joints = 3.0
"""
    )
    mine, base = load_problem(write(tmp_path, text)), load_problem("refine")
    theirs = {item.name: item for item in base.terms}
    ours = {item.name: item for item in mine.terms}
    assert list(ours) == [name for name in theirs if name not in ("contact_wrench", "posture")] + ["velocity"]
    jerk, was = ours["jerk"].term, theirs["jerk"].term
    assert jerk.joints == 123.0 and jerk.base_position == was.base_position  # type: ignore[attr-defined]
    assert ours["ground"] == theirs["ground"] and mine.passes == 2


def test_options_are_merged_and_strategies_replaced(tmp_path: Path) -> None:
    text = HEAD + '[solver.options]\ntol = 0.25\n[[solver.first]]\nname = "only"\nmax_iter = 7\n'
    mine, base = load_problem(write(tmp_path, text)), load_problem("refine")
    (only,) = mine.first
    assert only.name == "only" and only.options["tol"] == 0.25 and only.options["max_iter"] == 7
    assert only.options["acceptable_tol"] == base.first[-1].options["acceptable_tol"]
    assert [attempt.name for attempt in mine.again] == [attempt.name for attempt in base.again]


def test_a_base_beside_the_file_and_a_chain(tmp_path: Path) -> None:
    write(tmp_path, HEAD + "passes = 5\n", "ours.toml")
    mine = write(tmp_path, 'base = "ours.toml"\nname = "mine"\nwithout = ["jerk"]\n')
    problem = load_problem(mine)
    assert problem.passes == 5 and "jerk" not in [item.name for item in problem.terms]
    assert [path.name for path in problem_files(mine)] == ["mine.toml", "ours.toml", "refine.toml"]


def test_the_kinematic_problem_is_the_default_one_without_physics() -> None:
    kinematic, default = load_problem("refine_kinematic"), load_problem("refine")
    assert any(item.term.dynamic for item in default.terms)
    assert not any(item.term.dynamic for item in kinematic.terms)
    assert len(kinematic.terms) == len(default.terms) - 1


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('base = "mine.toml"\nname = "mine"\n', "is its own base"),
        (HEAD + 'without = ["gravity"]\n', "without has 'gravity'; the terms of its base refine are tracking"),
        (HEAD + 'without = "jerk"\n', "without is 'jerk'; expected a list of names"),
        ("base = 3\n", "base is 3; expected a text"),
        (HEAD + "[[terms]]\njoints = 1.0\n", "has no 'type'"),
        (HEAD + '[[terms]]\ntype = "jerk"\nspeed = 1.0\n', "unknown field 'speed'"),
        (HEAD + '[[terms]]\ntype = "velocity"\njoints = 1.0\n', "has no 'use'"),
        (HEAD + "solver = 3\n", "expected a table"),
        (HEAD + "colour = 3\n", "unknown field 'colour'"),
    ],
)
def test_mistakes_are_said(tmp_path: Path, text: str, complaint: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ProblemError, match=r"mine\.toml") as caught:
        load_problem(path)
    assert complaint in str(caught.value)


def test_a_base_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(ResourceError, match="peace"):
        load_problem(write(tmp_path, 'base = "peace"\nname = "mine"\n'))


def test_a_problem_to_solve_otherwise_that_does_not_exist_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(ResourceError, match="peace"):
        load_problem(write(tmp_path, HEAD + 'otherwise = "peace"\n'))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("rise = -0.01", "rise is -0.01; expected a positive number, or 0"),
        ("free = -1.0", "free is -1; expected a positive number, or 0"),
        ("free = 1.5", "free is 1.5; expected a share of at most 1"),
        ("limb = -0.004", "limb is -0.004; expected a positive number, or 0"),
    ],
)
def test_what_a_stance_may_leave_out_is_no_less_than_nothing(tmp_path: Path, text: str, complaint: str) -> None:
    head = HEAD + '[[terms]]\ntype = "stance_anchor"\n'
    with pytest.raises(ProblemError, match=re.escape(complaint)):
        load_problem(write(tmp_path, head + text))
    name = text.partition(" ")[0]
    terms = load_problem(write(tmp_path, f"{head}{name} = 0")).terms
    assert getattr(next(item.term for item in terms if isinstance(item.term, StanceAnchor)), name) == 0.0
