"""Decide which feet stand when: detect the contact schedule, change it, refine with it.

The schedule decides more about the result than any weight.  On the command line: `--save-contacts contacts.json`, an
editor, `--contacts contacts.json`.
"""

from dataclasses import replace
from pathlib import Path

from gmr_traj.contacts import schedule_json
from gmr_traj.contacts.detect import detect
from gmr_traj.formats import read_clip
from gmr_traj.metrics import measure
from gmr_traj.problem import load_problem
from gmr_traj.refine import refine
from gmr_traj.robot_loading import load_robot

robot = load_robot("unitree_g1")
motion = read_clip(Path(__file__).with_name("punch.npz"), robot).motion

detected = detect(motion, robot)
print(f"{len(detected.stances)} stances of single sole points; the clip is raised by {1e3 * detected.height:.0f} mm")

# Leave the left toe free: whatever it does on the floor is meant.
stances = tuple(s for s in detected.stances if not (s.sole == "left" and s.part == "toe"))
edited = replace(detected, stances=stances)
Path("contacts.json").write_text(schedule_json.to_json(edited))

problem = load_problem("refine")
for name, schedule in (("detected", detected), ("left toe free", edited)):
    refinement = refine(motion, robot, problem, schedule=schedule)
    figures = measure(refinement.motion, robot, detected)
    print(f"{name:14} {refinement.report.status}: over all {figures.stances} detected stances")
    print(f"{'':14} drift at most {figures.drift_max:.1f} mm, sliding {figures.slide_mean:.1f} mm/s on average")
