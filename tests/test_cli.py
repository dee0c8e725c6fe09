"""The command's frame: help, exit codes, errors as one line."""

import os
import subprocess
import sys
import time
from typing import get_args

import pytest

from gmr_traj import __version__
from gmr_traj.cli import arguments
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main
from gmr_traj.exceptions import ClipError
from gmr_traj.formats.clip import FORMATS, SUFFIXES


def run_help(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    with pytest.raises(SystemExit) as exit_:
        main([*argv, "--help"])
    assert exit_.value.code == 0
    return capsys.readouterr().out


def test_help_lists_subcommands_and_every_exit_code(capsys):
    text = run_help(capsys)
    for word in (
        "refine",
        "inspect",
        "view",
        "render",
        "report",
        "bench",
        *(f"{code.value}  {code.meaning}" for code in ExitCode),
    ):
        assert word in text


def test_no_arguments_is_help(capsys):
    with pytest.raises(SystemExit) as exit_:
        main([])
    assert exit_.value.code == 0
    assert "usage: gmr-traj" in capsys.readouterr().out


@pytest.mark.parametrize("subcommand", ["refine", "inspect", "view", "render", "report", "bench"])
def test_subcommand_help(capsys, subcommand):
    text = run_help(capsys, subcommand)
    for option in ("--robot", "--input-format", "--fps", "--quaternion", "--traceback"):
        assert option in text


def test_help_is_fast_and_loads_nothing_heavy():
    script = (
        "import sys\n"
        "from gmr_traj.cli.main import main\n"
        "try:\n    main(['refine', '--help'])\n"
        "except SystemExit:\n    pass\n"
        "heavy = {'casadi', 'fcl', 'mujoco', 'numpy', 'PIL', 'pinocchio', 'rerun', 'scipy'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
    )
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    elapsed = time.perf_counter() - start
    assert done.stderr.strip() == "[]"
    assert elapsed < 2.0  # 0.3 s on an idle machine; the modules above are what would cost seconds


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"gmr-traj {__version__}\n"


def test_python_dash_m():
    done = subprocess.run([sys.executable, "-m", "gmr_traj", "--version"], capture_output=True, text=True, check=True)
    assert __version__ in done.stdout


@pytest.mark.parametrize(
    "argv", [["refine"], ["refine", "a.npz", "--fps", "fast"], ["polish", "a.npz"], ["refine", "a", "--x"]]
)
def test_bad_usage_is_code_2(capsys, argv):
    with pytest.raises(SystemExit) as exit_:
        main(argv)
    assert exit_.value.code == ExitCode.BAD_INPUT
    assert capsys.readouterr().out == ""


def test_inspect_of_nothing_is_bad_usage(capsys):
    assert main(["inspect"]) == ExitCode.BAD_INPUT
    assert "at least one clip" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (
            ClipError("a.npz: frame 3 has\nvalues that are not finite"),
            ExitCode.BAD_INPUT,
            "error: a.npz: frame 3 has values",
        ),
        (PermissionError(13, "Permission denied", "a.npz"), ExitCode.BAD_INPUT, "error: a.npz: Permission denied"),
        (KeyboardInterrupt(), ExitCode.INTERRUPTED, "interrupted; nothing was written"),
        (ZeroDivisionError("division by zero"), ExitCode.INTERNAL_ERROR, "internal error: ZeroDivisionError: division"),
    ],
)
@pytest.mark.parametrize("traceback", ["option", "variable", "no"])
def test_errors_are_one_line_and_a_code(capsys, monkeypatch, error, code, text, traceback):
    def run(self: arguments.Inspect) -> int:
        raise error

    monkeypatch.setattr(arguments.Inspect, "run", run)
    monkeypatch.setenv("GMR_TRAJ_TRACEBACK", "1" if traceback == "variable" else "0")
    assert main(["inspect", "a.npz", *(["--traceback"] if traceback == "option" else [])]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    *before, last = captured.err.splitlines()
    assert last.startswith(f"gmr-traj: {text}")
    assert any("Traceback" in line for line in before) == (traceback != "no")


def test_a_reader_that_leaves_is_no_error():
    script = (
        "from gmr_traj.cli import arguments\n"
        "from gmr_traj.cli.main import main\n"
        "import sys\n"
        "def run(self):\n    [print('x' * 1000) for _ in range(10000)]\n    return 0\n"
        "arguments.Inspect.run = run\n"
        "sys.exit(main(['inspect', 'a']))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(timeout=30) == 0
    assert process.stderr.read() == ""


def test_the_options_name_every_format():
    assert set(get_args(arguments.Format)) == set(FORMATS) == set(SUFFIXES)


def test_a_reader_of_the_help_that_leaves_is_no_error() -> None:
    """As with ``gmr-traj verify --help | head -0``."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as closed:
        command = [sys.executable, "-m", "gmr_traj", "verify", "--help"]
        done = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
