"""How high the source's targets stand: the one constant that puts the source's feet on the floor, too."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Robot


def source_height(references: BodyTargets, robot: Robot, schedule: ContactSchedule) -> float:
    """Height to add to the targets so that sole points in stance are on the floor in the median.

    A retargeted clip is levelled by its lowest feet, and hovers over the floor in most stances, by a centimetre or two.
    Its feet are pulled down to the floor; without the same for the targets of knees, root and arms the body would be
    pulled apart, up to the knees' full length.

    Args:
        references: the targets.
        robot: its soles are used, of bodies that have a target of their position.
        schedule: the stances.

    Returns:
        The height [m]; that of the schedule where no stance is of a foot with a target.
    """
    heights = []
    for sole in robot.soles:
        if sole.body not in references.names:
            continue
        k = references.names.index(sole.body)
        if references.position_weights[k] <= 0:
            continue
        rotation = Rotation.from_quat(references.quaternions[:, k], scalar_first=True).as_matrix()
        arms = sole.points - references.points[k]
        z = references.positions[:, k, None, 2] + rotation[:, 2] @ arms.T  # (T, points)
        heights += [z[s.start : s.stop, s.point] for s in schedule.stances if s.sole == sole.name]
    return -float(np.median(np.concatenate(heights))) if heights else schedule.height
