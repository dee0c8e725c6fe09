"""BVH files: Euler channels per joint, of any rig.

End Sites are no joints: they have no orientation, and no map refers to them.
"""

from __future__ import annotations

import numpy as np

from gmr_traj.formats.human import bvh_file
from gmr_traj.formats.human.bvh_file import BvhFile
from gmr_traj.formats.human.frame_rate import frame_rate
from gmr_traj.formats.human.kinematics import world_placements
from gmr_traj.formats.human.raw import RawHuman
from gmr_traj.quaternions import from_euler


def read(data: bytes) -> RawHuman:
    """The motion of a BVH file, in its own axes and unit, neither of which the format fixes.

    Raises:
        ClipError: it is cut or not BVH.
    """
    content = bvh_file.parse(data)
    fps, note = frame_rate(content.frame_time)
    names = tuple(joint.name for joint in content.joints)
    parents = tuple(joint.parent for joint in content.joints)
    positions, quaternions = world_placements(parents, *local_placements(content))
    offsets = np.array([joint.offset for joint in content.joints])
    return RawHuman(names, parents, positions, quaternions, fps, offsets=offsets, notes=(note,))


def local_placements(content: BvhFile) -> tuple[np.ndarray, np.ndarray]:
    """Every joint's placement in its parent's frame.

    A position channel stands in place of the OFFSET along its axis, for the root and for any other joint: files
    that have position channels repeat the bone in them.  Rotations multiply in the order of the joint's channels
    (intrinsic): ``R = R_1(c_1) R_2(c_2) R_3(c_3)``.

    Returns:
        Translations in the file's unit and quaternions wxyz.  # (T, J, 3), (T, J, 4)
    """
    frames, joints = len(content.values), len(content.joints)
    translations = np.empty((frames, joints, 3))
    rotations = np.zeros((frames, joints, 4))
    rotations[..., 0] = 1.0
    orders: dict[str, tuple[list[int], list[list[int]]]] = {}
    for j, joint in enumerate(content.joints):
        translations[:, j] = joint.offset
        order, columns = "", []
        for column, channel in enumerate(joint.channels, start=joint.column):
            if channel.endswith("position"):
                translations[:, j, "XYZ".index(channel[0])] = content.values[:, column]
            else:
                order += channel[0]
                columns.append(column)
        if order:
            found = orders.setdefault(order, ([], []))
            found[0].append(j)
            found[1].append(columns)
    for order, (turned, of_order) in orders.items():  # one call for all joints that share an order
        angles = np.radians(content.values.T[np.transpose(of_order)])  # (axes, joints, T)
        rotations[:, turned] = from_euler(order, list(angles)).transpose(2, 1, 0)
    return translations, rotations
