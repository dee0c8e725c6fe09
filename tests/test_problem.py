"""Problem files: those that ship, what a user may write, and one line for everything that is wrong."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from optimiser_setup import EXAMPLE

from gmr_traj import resources
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.exceptions import ProblemError, ResourceError
from gmr_traj.problem import load_problem
from gmr_traj.terms import CONSTRAINTS, TERMS

TEXT = """
name = "mine"
passes = 2

[[terms]]
type = "tracking"
use = "cost"
position = 0.03
orientation = 0.15
robust = 0.05

[[terms]]
type = "joint_position"
use = "hard"
margin = 0

[solver.options]
tol = 0.03

[[solver.first]]
name = "quick"
max_iter = 10

[[solver.first]]
name = "careful"
tol = 0.01

[[solver.again]]
name = "again"
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", resources.names("problems"))
def test_every_problem_that_ships_loads(name: str) -> None:
    problem = load_problem(name)
    assert problem.terms and problem.first and problem.again
    for item in problem.terms:
        kind = TERMS[item.name] if item.use == "cost" else CONSTRAINTS.get(item.name, TERMS[item.name])
        assert type(item.term) is kind and item.use in item.term.uses


def test_a_problem_of_ones_own(tmp_path: Path) -> None:
    problem = load_problem(write(tmp_path, TEXT))
    assert (problem.name, problem.passes, problem.path) == ("mine", 2, tmp_path / "mine.toml")
    tracking, limit = problem.terms
    assert (tracking.name, tracking.use, tracking.term) == ("tracking", "cost", TERMS["tracking"](0.03, 0.15, 0.05))
    assert (limit.name, limit.use, limit.term) == ("joint_position", "hard", TERMS["joint_position"](0.0))
    # Common options first, a strategy's own on top; the name is none.
    assert [dict(attempt.options) for attempt in (*problem.first, *problem.again)] == [
        {"tol": 0.03, "max_iter": 10},
        {"tol": 0.01},
        {"tol": 0.03},
    ]
    assert [attempt.name for attempt in problem.first] == ["quick", "careful"]


def test_passes_and_options_may_be_left_out(tmp_path: Path) -> None:
    text = TEXT.replace("passes = 2", "").replace("[solver.options]\ntol = 0.03", "")
    problem = load_problem(write(tmp_path, text))
    assert problem.passes == 3 and problem.again[0].options == {}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (TEXT, "name = = 3", "is not valid TOML"),
        (TEXT, "", "has no 'name'"),
        ('name = "mine"', "name = 3", "name is 3; expected a text"),
        ("passes = 2", "passes = 2.0", "passes is 2.0; expected a whole number from 1 to 20"),
        ("passes = 2", "passes = 0", "passes is 0; expected a whole number from 1 to 20"),
        ("passes = 2", "passes = true", "passes is True; expected a whole number"),
        ("passes = 2", "pases = 2", "has the unknown field 'pases'; the fields are .*passes"),
        ("passes = 2", "description = 3", "description is 3; expected a text"),
        ('type = "tracking"', 'type = "trakcing"', "entry 1 has type 'trakcing'; there are acceleration, .*tracking"),
        ('type = "tracking"', "", r"entry 1 has no 'type'"),
        ('use = "cost"', 'use = "hard"', r"entry 1 \(tracking\) has use 'hard'; it can be cost"),
        ('use = "cost"', 'use = "costs"', r"entry 1 \(tracking\) has use 'costs'; it can be cost"),
        ("robust = 0.05", "", r"entry 1 \(tracking\) has no 'robust'"),
        ("robust = 0.05", "robust = 0.05\nrobst = 1", r"\(tracking\) has the unknown field 'robst'; .*robust"),
        ("robust = 0.05", 'robust = "0.05"', "robust is '0.05'; expected a positive number"),
        ("robust = 0.05", "robust = true", "robust is True; expected a positive number"),
        ("robust = 0.05", "robust = nan", "robust is nan; expected a positive number"),
        ("robust = 0.05", "robust = inf", "robust is inf; expected a positive number"),
        ("robust = 0.05", "robust = 0", "robust is 0; expected a positive number"),
        ("robust = 0.05", "robust = -1", "robust is -1; expected a positive number"),
        ("robust = 0.05", f"robust = 1{'0' * 400}", "robust is 10*; expected a positive number"),
        ("margin = 0", "margin = [0]", r"entry 2 \(joint_position\) margin is \[0\]; expected a number"),
        ("[solver.options]\ntol = 0.03", "[solver]\noptions = 3", r"\[solver.options\] is 3; expected a table"),
        ("[solver.options]", "[solver]\nretries = 1\n[solver.options]", r"\[solver\] has the unknown field 'retries'"),
        ('[[solver.again]]\nname = "again"', "", r"\[solver\] has no 'again'"),
        ('name = "quick"', "", r"\[\[solver.first\]\] entry 1 has no 'name'"),
        ("tol = 0.01", "tolerance = 1", r"entry 2 \(careful\): Ipopt does not take tolerance = 1"),
        ("tol = 0.03", 'tol = "small"', r"entry 1 \(quick\): Ipopt does not take tol = 'small'"),
        ('name = "quick"', 'name = "quick"\nengine = "snopt"', r"\(quick\) has engine 'snopt'; there are ipopt, band"),
        ('name = "quick"', 'name = "a"\nengine = "band"\nmu = 1', r"unknown option 'mu' of engine band; .*mu_init"),
        (
            'name = "quick"',
            'name = "a"\nengine = "band"\nacceptable_iter = 1.5',
            "is 1.5; expected a positive whole number",
        ),
        ('name = "quick"', 'name = "a"\nengine = "band"\nbound_push = 0', "is 0; expected a positive number"),
        ('name = "quick"', 'name = "a"\nengine = "band"\nmu_init = "x"', "is 'x'; expected a positive number"),
        ("tol = 0.01", 'mu_strategy = "bold"', "Ipopt does not take mu_strategy = 'bold'"),
        ("tol = 0.01", 'linear_solver = "ma57"', "Ipopt does not take linear_solver = 'ma57'"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    assert TEXT.count(old) == 1
    path = write(tmp_path, TEXT.replace(old, new))
    with pytest.raises(ProblemError, match=message) as raised:
        load_problem(path)
    assert str(raised.value).startswith(f"{path}: ") and "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (
            'type = "ground"\nuse = "hard"\nclearance = 0.01\nnear = 0.01\nscale = 1',
            r"\(ground\) near is 0.01, not above clearance, 0.01: rows that are violated are not built",
        ),
        (
            'type = "joint_velocity"\nuse = "hard"\nfactor = 0.9\nnear = 1.1',
            r"\(joint_velocity\) near is 1.1; above 1, rows that are violated are not built",
        ),
    ],
)
def test_fields_that_would_lose_rows(tmp_path: Path, term: str, message: str) -> None:
    text = TEXT.replace('type = "joint_position"\nuse = "hard"\nmargin = 0', term)
    with pytest.raises(ProblemError, match=message):
        load_problem(write(tmp_path, text))


def test_terms_that_are_no_tables(tmp_path: Path) -> None:
    head, tail = TEXT.split("[[terms]]")[0], TEXT[TEXT.index("[solver.options]") :]
    for terms, message in (
        ("terms = [1]\n", r"\[\[terms\]\] entry 1 is 1; expected a table"),
        ("terms = 1\n", r"terms is 1; expected \[\[terms\]\] entries"),
        ("terms = []\n", r"terms is \[\]; expected \[\[terms\]\] entries"),
        ("", "has no 'terms'"),
    ):
        with pytest.raises(ProblemError, match=message):
            load_problem(write(tmp_path, head + terms + tail))


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ProblemError, match="is not valid TOML"):
        load_problem(path)


def test_a_name_that_is_unknown() -> None:
    with pytest.raises(ResourceError, match=r"peace: no such file, and no problem of that name; there are: .*refine"):
        load_problem("peace")


@given(st.sampled_from(sorted(TERMS)), st.floats(1e-6, 1e6))
def test_every_term_takes_its_fields_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, name: str, value: float
) -> None:
    kind = TERMS[name]
    values = {field.name: value for field in fields(kind)}
    if "near" in values:
        values["near"] = 0.5 if "factor" in values else 2 * value
    if "free" in values:
        values["free"] = min(1.0, value)  # a share
    lines = [
        f'type = "{name}"',
        f'use = "{kind.uses[0]}"',
        *[f"{field} = {number!r}" for field, number in values.items()],
    ]
    text = TEXT[: TEXT.index("[[terms]]")] + "[[terms]]\n" + "\n".join(lines) + TEXT[TEXT.index("\n[solver.options]") :]
    (item,) = load_problem(write(tmp_path_factory.getbasetemp(), text)).terms
    assert item.term == kind(**values)


def test_the_users_path(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """`--problem PATH`: a wrong file is one line and code 2; nothing is written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    write(tmp_path, TEXT.replace("robust = 0.05", "robust = 0"))
    assert main(["refine", "punch.npz", "--problem", "mine.toml"]) == ExitCode.BAD_INPUT
    error = capsys.readouterr().err
    assert re.fullmatch(r"gmr-traj: error: .*mine\.toml: .* robust is 0; expected a positive number\n", error)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.toml", "punch.npz"]
