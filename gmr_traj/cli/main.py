"""The command `gmr-traj`: its subcommands, and how errors become one line and an exit code.

Nothing heavy is imported here: `--help` answers before CasADi, MuJoCo or Pinocchio are loaded.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import tyro

from gmr_traj._version import __version__
from gmr_traj.cli import (
    arguments,
    batch_arguments,
    bench_arguments,
    compare_arguments,
    make_map_arguments,
    refine_arguments,
    render_arguments,
    report_arguments,
    retarget_arguments,
    verify_arguments,
    view_arguments,
)
from gmr_traj.cli.exit_codes import ExitCode, table
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.memory import keep_freed

DESCRIPTION = f"""Whole-clip trajectory optimisation for humanoid motion retargeting (version {__version__}).

A motion clip goes in, a clip the robot can follow comes out, with the proof beside it.

exit codes:
{table()}"""

Command = (
    Annotated[refine_arguments.Refine, tyro.conf.subcommand("refine")]
    | Annotated[batch_arguments.Batch, tyro.conf.subcommand("batch")]
    | Annotated[arguments.Inspect, tyro.conf.subcommand("inspect")]
    | Annotated[view_arguments.View, tyro.conf.subcommand("view")]
    | Annotated[render_arguments.Render, tyro.conf.subcommand("render")]
    | Annotated[report_arguments.Report, tyro.conf.subcommand("report")]
    | Annotated[bench_arguments.Bench, tyro.conf.subcommand("bench")]
    | Annotated[retarget_arguments.Retarget, tyro.conf.subcommand("retarget")]
    | Annotated[make_map_arguments.MakeMap, tyro.conf.subcommand("make-map")]
    | Annotated[compare_arguments.Compare, tyro.conf.subcommand("compare")]
    | Annotated[verify_arguments.Verify, tyro.conf.subcommand("verify")]
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        argv: arguments without the program's name; those of the process by default.

    Returns:
        An exit code, see `gmr_traj.cli.exit_codes`.
    """
    given = list(sys.argv[1:] if argv is None else argv)
    if given == ["--version"]:
        print(f"gmr-traj {__version__}")
        return ExitCode.OK
    try:
        command: arguments.Subcommand = tyro.cli(
            Command,
            prog="gmr-traj",
            description=DESCRIPTION,
            args=given or ["--help"],
            config=(tyro.conf.FlagCreatePairsOff,),
        )
    except BrokenPipeError:
        return _nobody_reads()
    # One thread each: idle BLAS threads spin beside Ipopt, and a sum's order must not depend on the machine's load.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    # MuJoCo looks for a window system when it is imported, a tenth of a second; pictures are drawn without one.
    if sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "disable")
    keep_freed()
    try:
        return int(command.run())
    except KeyboardInterrupt:
        return _end("interrupted; nothing was written", ExitCode.INTERRUPTED, command)
    except BrokenPipeError:
        return _nobody_reads()
    except GmrTrajError as error:
        return _end(f"error: {error}", ExitCode.BAD_INPUT, command)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _end(f"error: {where}{error.strerror or error}", ExitCode.BAD_INPUT, command)
    except Exception as error:
        line = f"internal error: {type(error).__name__}: {error} (this is a fault in gmr-traj; --traceback shows where)"
        return _end(line, ExitCode.INTERNAL_ERROR, command)


def _nobody_reads() -> int:
    """The reader of our output left (`| head`): not an error, but nothing more can be printed, at exit either."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return ExitCode.OK


def _end(line: str, code: ExitCode, command: arguments.Subcommand) -> int:
    """Say one line on stderr, after the traceback where one is wanted."""
    if command.traceback or os.environ.get("GMR_TRAJ_TRACEBACK", "0") not in ("", "0"):
        traceback.print_exc()
    print("gmr-traj: " + " ".join(line.split()), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
