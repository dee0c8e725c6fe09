"""The numbered examples run as they stand, in a folder of their own, and print what they promise."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
PROGRAMS = sorted(EXAMPLES.glob("[0-9][0-9]_*.py"))


def test_the_examples_are_numbered_without_gaps_and_listed():
    assert [int(p.name[:2]) for p in PROGRAMS] == list(range(1, len(PROGRAMS) + 1))
    listed = (EXAMPLES / "README.md").read_text()
    assert all(f"]({p.name})" in listed for p in PROGRAMS)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.stem)
def test_example_runs(program, tmp_path):
    variables = os.environ | {"PYTHONPATH": str(EXAMPLES.parent), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(program)]
    done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= 3
    assert "BROKEN" not in done.stdout and "not converged" not in done.stdout
