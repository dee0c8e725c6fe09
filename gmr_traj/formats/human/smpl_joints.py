"""Joints of the SMPL family: names, order and parents, and which parameters turn them."""

from __future__ import annotations

from collections.abc import Mapping

_BODY = (
    "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot right_foot "
    "neck left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist"
).split()
_BODY_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
_FINGERS = [
    f"{side}_{finger}{k}"
    for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb")
    for k in (1, 2, 3)
]

#: Number of joints of the body, which all models share.
BODY = len(_BODY)

#: Joints by model, in the order of the pose parameters, three to a joint.
JOINTS: Mapping[str, tuple[str, ...]] = {
    "smpl": (*_BODY, "left_hand", "right_hand"),
    "smplh": (*_BODY, *_FINGERS),
    "smplx": (*_BODY, "jaw", "left_eye_smplhf", "right_eye_smplhf", *_FINGERS),
}


def parents(model: str) -> tuple[int, ...]:
    """Index of each joint's parent, -1 for the pelvis."""
    names = JOINTS[model]
    found = list(_BODY_PARENTS)
    for k in range(BODY, len(names)):
        name = names[k]
        if name[-1] in "23":
            found.append(k - 1)  # along a finger
        elif name.startswith(("jaw", "left_eye", "right_eye")):
            found.append(names.index("head"))
        else:
            found.append(names.index("left_wrist" if name.startswith("left") else "right_wrist"))
    return tuple(found)
