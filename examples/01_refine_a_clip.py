"""Refine a clip: read it, solve, write, and measure what was written.

`gmr-traj refine examples/punch.npz` does the same and more.
"""

from pathlib import Path

from gmr_traj.formats import read_clip, write_clip
from gmr_traj.metrics import certify
from gmr_traj.problem import load_problem
from gmr_traj.refine import refine
from gmr_traj.robot_loading import load_robot

robot = load_robot("unitree_g1")
clip = read_clip(Path(__file__).with_name("punch.npz"), robot)
print(f"{clip.motion.frames} frames at {clip.motion.fps:g} Hz, format {clip.format}")

refinement = refine(clip.motion, robot, load_problem("refine"))
report = refinement.report
print(f"{report.status} ({report.solver_status}) after {report.iterations} iterations")
for term in report.terms:
    print(f"  {term.name:16} {term.use:5} value {term.value:10.4g}  largest violation {term.violation:.2g} {term.unit}")

write_clip(clip.with_motion(refinement.motion), "punch_refined.npz")
written = read_clip("punch_refined.npz", robot)
schedule = refinement.schedule
certificate = certify(clip.motion, written.motion, robot, schedule, levelling=schedule.height)
for promise in certificate.promises:
    print(f"  {'held  ' if promise.held else 'BROKEN'} {promise.sentence}: {promise.value:.3g} {promise.unit}")
