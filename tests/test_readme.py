"""The README's two commands, and that CI runs them as they stand there."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"^```sh\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def test_the_first_two_shell_blocks_are_one_command_each():
    for block in BLOCKS[:2]:
        assert block.count("\n") == 1
    assert "gmr-traj refine examples/" in BLOCKS[0]
    assert BLOCKS[1].rstrip().endswith("pytest")


def test_the_example_of_the_first_command_exists():
    (clip,) = re.findall(r"examples/\S+\.npz", BLOCKS[0])
    assert (ROOT / clip).is_file()


@pytest.mark.parametrize("block", [1, 2])
def test_ci_runs_the_readme_s_commands(block):
    """CI's own extraction, run, gives the README's block with another environment's path."""
    script = (ROOT / ".ci" / "run").read_text()
    (function,) = re.findall(r"^readme\(\) \{.*\}$", script, re.MULTILINE)
    assert f"command=$(readme {block})" in script
    done = subprocess.run(
        ["bash", "-euc", f"scratch=/scratch; {function}; readme {block}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == BLOCKS[block - 1].replace(".venv", "/scratch/venv")


def test_local_links_and_pictures_exist():
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", TEXT):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target


def test_options_named_in_the_readme_exist(capsys):
    from gmr_traj.cli.main import main

    known = ""
    for subcommand in (
        "refine",
        "retarget",
        "compare",
        "inspect",
        "view",
        "render",
        "report",
        "verify",
        "make-map",
        "bench",
        "batch",
    ):
        with pytest.raises(SystemExit):
            main([subcommand, "--help"])
        known += capsys.readouterr().out
    prose = re.sub(r"^```.*?^```$", "", TEXT, flags=re.MULTILINE | re.DOTALL)
    for option in set(re.findall(r"`(?:gmr-traj [^`]*?)?(--[a-z-]+)", prose)):
        assert option in known, option
