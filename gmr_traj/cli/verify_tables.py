"""Tables of `gmr-traj verify`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from gmr_traj.cli.tables import artefacts, plain_table
from gmr_traj.text import number

if TYPE_CHECKING:
    from gmr_traj.cli.verify import Verified

_PASSED = {True: "[green]passes[/green]", False: "[bold red]FAILS[/bold red]"}


def show(screen: Console, found: Sequence[Verified], top: int) -> None:
    """Print the audits of all clips in a table, then what is wrong with each."""
    names = [verified.name for verified in found]
    if any(verified.trials for verified in found):
        screen.print("[bold]rollouts[/bold]: what a simulated robot makes of it")
        screen.print(rollout_table(names, found))
        screen.print()
    screen.print("[bold]audit[/bold]: what the motion needs that floor and motors cannot give")
    screen.print(audit_table(names, found))
    for name, verified in zip(names, found, strict=True):
        audit = verified.audit
        if verified.stable is not None:
            screen.print(f"{escape(name)}: stable from frame {verified.stable.start} to {verified.stable.stop - 1}")
        elif verified.sought:
            screen.print(f"{escape(name)}: nowhere to begin: no stretch of it is stable", style="red")
        for failure in audit.failures:
            screen.print(f"{escape(name)}: {escape(failure)}", style="red")
        if top and audit.faults:
            shown = min(top, len(audit.faults))
            screen.print(f"\n[bold]{escape(name)}[/bold]: the worst {shown} of {len(audit.faults)} faults")
            screen.print(artefacts(audit.faults, top))


def audit_table(names: Sequence[str], found: Sequence[Verified]) -> Table:
    """One line a clip."""
    table = plain_table(
        "clip", ">s", ">infeasible", ">force mg", ">max", ">moment mgm", ">max", ">torque/limit", "joint",
        ">depth mm", ">ZMP outside", ">CoM-CoP mm", "",
    )  # fmt: skip
    for name, verified in zip(names, found, strict=True):
        s = verified.audit.summary()
        table.add_row(
            escape(name),
            f"{verified.motion.duration:.1f}",
            f"{100 * s['infeasible_share']:.0f} %",
            number(s["residual_force_mean"]),
            number(s["residual_force_max"]),
            number(s["residual_moment_mean"]),
            number(s["residual_moment_max"]),
            number(s["joint_torque_max"]),
            escape(s["joint_torque_joint"].removesuffix("_joint")),
            number(1e3 * s["depth_max"]),
            "-" if s["zmp_outside_share"] is None else f"{100 * s['zmp_outside_share']:.0f} %",
            "-" if s["com_cop_mean"] is None else number(1e3 * s["com_cop_mean"]),
            _PASSED[verified.audit.passed],
        )
    return table


def rollout_table(names: Sequence[str], found: Sequence[Verified]) -> Table:
    """One line for each clip, set of conditions and start frame: means over the trials, errors before any fall."""
    table = plain_table(
        "clip", "conditions", ">frames", "controller", ">success", ">full rule", ">alive s", ">E_g mm", ">E mm",
        ">E_joint mrad", ">norm", "first fall",
    )  # fmt: skip
    for name, verified in zip(names, found, strict=True):
        for trials in verified.trials:
            count = len(trials.rollouts)
            fallen = next((r.tracking for r in trials.rollouts if not r.tracking.success), None)
            alive, length = trials.mean("alive"), trials.mean("length")
            used = sorted({rollout.controller for rollout in trials.rollouts})
            table.add_row(
                escape(name),
                escape(trials.conditions),
                f"{trials.start_frame}-{(trials.stop_frame or verified.motion.frames) - 1}",
                escape(", ".join(used)),
                f"{round(trials.success * count)}/{count}",
                f"{round(trials.mean('success_full') * count)}/{count}",
                f"{alive:.1f}/{length:.1f}",
                number(trials.mean("g_mpbpe")),
                number(trials.mean("mpbpe")),
                number(trials.mean("mpjpe")),
                number(trials.mean("mpjpe_norm")),
                "" if fallen is None else f"{fallen.fell:.2f} s: {escape(fallen.reason)}",
            )
    return table
