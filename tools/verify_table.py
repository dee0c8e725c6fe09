"""Refine clips, and let a simulated robot follow each raw and refined: the tables of docs/verify.md.

    python tools/verify_table.py DATA/gmr_pkl DATA/gmr_reference --work /tmp/table
    python tools/verify_table.py CLIP... --work /tmp/noise --conditions sim-dr sim2sim --trials 5 --preset A

Of every clip the same seconds are taken raw and refined: the first ten, after the first 0.2 s where its first frames
are a transient.  Where neither is followed from there, both begin again where `--find-start` has the refined one begin.
Refined clips and finished rows are kept in the folder --work, so that an interrupted run goes on where it was.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj.cli.clip_files import clip_files
from gmr_traj.cli.exit_codes import ExitCode
from gmr_traj.cli.main import main as command
from gmr_traj.formats import read_clip
from gmr_traj.lead.lead_in import spoiled
from gmr_traj.motion import RobotMotion
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot, reduce_robot
from gmr_traj.verify.audit import audit
from gmr_traj.verify.conditions import load_conditions
from gmr_traj.verify.stable import stable_span
from gmr_traj.verify.trials import Choice, Job, Trials, run_jobs

AFTER = 0.2  # [s] where a clip begins whose first frames are a transient
KINDS = ("raw", "refined")


def main() -> None:
    """Make the rows that are missing, then print all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", nargs="+", type=Path, help="clips, or folders of clips")
    parser.add_argument("--work", type=Path, required=True, help="folder for refined clips and finished rows")
    parser.add_argument("--robot", default="unitree_g1")
    parser.add_argument("--seconds", type=float, default=10.0, help="how much of every clip [s]")
    parser.add_argument("--conditions", nargs="+", default=["sim"])
    parser.add_argument("--trials", type=int, default=1, help="rollouts under conditions that hold anything random")
    parser.add_argument("--preset", choices=("auto", "A", "B"), default="auto")
    parser.add_argument("--refine", default="", help="further options of gmr-traj refine, in one string")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    rows = arguments.work / "rows.json"
    done: dict[str, Any] = json.loads(rows.read_text()) if rows.exists() else {}
    for path in clip_files(arguments.clips):
        if path.name not in done:
            done[path.name] = row(path, arguments)
            rows.write_text(json.dumps(done, indent=1))
            print(markdown({path.name: done[path.name]}).splitlines()[-1], flush=True)
    print(markdown(done))


def row(path: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """Everything about one clip.

    Raises:
        SystemExit: it could not be refined at all.
    """
    refined = arguments.work / f"{path.stem}_refined.npz"
    given = [*arguments.refine.split(), "--format", "gmr-traj", "--output", str(refined)]
    code = int(ExitCode.OK)
    if not refined.exists():
        code = command(["refine", str(path), "--robot", arguments.robot, *given, "--quiet"])
    if not refined.exists():
        raise SystemExit(f"{path}: refine ended with code {code} and left no clip")
    robot = load_robot(arguments.robot)
    motions = {"raw": read_clip(path, robot).motion, "refined": read_clip(refined, robot).motion}
    if motions["raw"].joint_names != robot.joint_names:
        robot = reduce_robot(robot, motions["raw"].joint_names)
    begin = AFTER if spoiled(motions["raw"]) else 0.0
    cut = {kind: stretch(motions[kind], begin, arguments.seconds) for kind in KINDS}
    out: dict[str, Any] = {"begin": begin, "seconds": cut["raw"].duration, "from": 0, "code": code}
    out |= {kind: figures(cut[kind], robot) for kind in KINDS}
    for kind in KINDS:
        out[kind]["trials"] = follow(cut[kind], robot, arguments)
    if not any(trials["success"] for kind in KINDS for trials in out[kind]["trials"]):
        span = stable_span(audit(cut["refined"], robot))
        if span is not None and 0 < span.start < cut["refined"].frames - 2:
            out["from"] = span.start
            for kind in KINDS:
                later = cut[kind].with_qpos(cut[kind].qpos[span.start :])
                out[kind]["later"] = follow(later, robot, arguments)
    return out


def stretch(motion: RobotMotion, begin: float, seconds: float) -> RobotMotion:
    """Some seconds of a motion."""
    first = round(begin * motion.fps)
    return motion.with_qpos(motion.qpos[first : first + round(seconds * motion.fps)])


def figures(motion: RobotMotion, robot: Robot) -> dict[str, Any]:
    """What the audit says."""
    found = audit(motion, robot)
    return {
        "passes": found.passed,
        "infeasible": float(found.share),
        "residual": float(found.residual_force.mean()),
        "torque_frames": int(np.count_nonzero((found.joint_torque > 1.0).any(axis=1))),
        "frames": motion.frames,
    }


def follow(motion: RobotMotion, robot: Robot, arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Rollouts under all conditions."""
    choice = Choice(presets=("A", "B") if arguments.preset == "auto" else (arguments.preset,))
    out = []
    for name in arguments.conditions:
        conditions = load_conditions(name)
        count = arguments.trials if conditions.random else 1
        jobs = [Job(robot.path, motion, conditions, choice, (0, k)) for k in range(count)]
        out.append(Trials(conditions.name, "clip", 0, tuple(run_jobs(jobs, 1))).to_json())
    return out


def markdown(rows: dict[str, Any]) -> str:
    """The table: a line a clip, one for each of the conditions."""
    columns = ("success, preset", "E_g [mm]", "infeasible", "residual [m g]", "torque frames")
    head = ["clip", *(f"{kind}: {column}" if not k else column for kind in KINDS for k, column in enumerate(columns))]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name, entry in rows.items():
        for which, begin in (("trials", 0), ("later", entry["from"])):
            for k in range(len(entry["raw"].get(which, ()))):
                found = {kind: entry[kind][which][k] for kind in KINDS}
                conditions = found["raw"]["conditions"]
                cells = [name + (f", from frame {begin}" if begin else "")]
                cells[0] += "" if conditions == "sim" else f", {conditions}"
                for kind in KINDS:
                    of = entry[kind]
                    cells += [outcome(found[kind]), f"{found[kind]['g_mpbpe']:.1f}"]
                    audited = f"{100 * of['infeasible']:.0f} %", f"{of['residual']:.3f}", str(of["torque_frames"])
                    cells += ("", "", "") if begin else audited
                lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def outcome(trials: dict[str, Any]) -> str:
    """How many trials were followed to the end, by which presets, or when the fall was."""
    each = trials["trials"]
    good = [trial for trial in each if trial["success"]]
    if len(each) > 1:
        return f"{len(good)}/{len(each)}"
    if not good:
        return f"falls at {each[0]['fell']:.1f} s"
    return f"1/1, {each[0]['controller'].split()[-1]}"


if __name__ == "__main__":
    main()
