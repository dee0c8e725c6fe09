"""What is wrong with a clip: which artefact, where, when, how bad.

`gmr-traj inspect examples/punch.npz` prints the same as a table.
"""

from pathlib import Path

from gmr_traj.contacts.detect import detect
from gmr_traj.formats import read_clip
from gmr_traj.metrics import artefacts, measure
from gmr_traj.robot_loading import load_robot

robot = load_robot("unitree_g1")
motion = read_clip(Path(__file__).with_name("punch.npz"), robot).motion
schedule = detect(motion, robot)

figures = measure(motion, robot, schedule)
print(f"fastest joint {figures.speed_max:.1f} rad/s ({figures.speed_joint}), {figures.jumps} jumps")
print(f"feet drift up to {figures.drift_max:.0f} mm in stance; lowest sole point {figures.sole_lowest:.0f} mm")

for found in artefacts(motion, robot, schedule)[:10]:
    print(f"{found.begin:5.2f}-{found.end:5.2f} s  {found.kind:18} {found.where:34} {found.value:7.1f} {found.unit}")
