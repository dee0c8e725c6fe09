"""Writing a human-to-robot map as the TOML file that ``load_map`` reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gmr_traj.retarget.body_map import BodyMap, Target


def to_toml(body_map: BodyMap, *, comment: str, joint_ranges: str = "", remarks: Sequence[str] = ()) -> str:
    """The text of a map file.

    Args:
        body_map: the map.
        comment: what a reader should know of the whole, without ``#``.
        joint_ranges: name of the joint ranges; the map itself knows only what they come to.
        remarks: one line a target, without ``#``.
    """
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    lines += [
        f"rigs = [{', '.join(_text(rig) for rig in body_map.rigs)}]",
        f"robot = {_text(body_map.robot)}",
        f"root = {_text(body_map.root)}",
        f"human_height = {body_map.human_height!r}",
    ]
    if joint_ranges:
        lines.append(f"joint_ranges = {_text(joint_ranges)}")
    if body_map.posture:
        lines += ["", "[posture]"]
        lines += [f"{_text(joint)} = {value!r}" for joint, value in body_map.posture.items()]
    for k, target in enumerate(body_map.targets):
        lines += ["", "[[targets]]", *([f"# {remarks[k]}"] if remarks else []), *_target(target)]
    return "\n".join(lines) + "\n"


def _target(target: Target) -> list[str]:
    lines = [f"joint = {_text(target.joint)}"]
    if target.orientation_joint != target.joint:
        lines.append(f"orientation_joint = {_text(target.orientation_joint)}")
    lines.append(f"body = {_text(target.body)}")
    if target.point.any():
        lines.append(f"point = {_numbers(target.point)}")
    lines.append(f"scale = {target.scale!r}")
    if target.position_offset.any():
        lines.append(f"position_offset = {_numbers(target.position_offset)}")
    lines.append(f"rotation_offset = {_numbers(target.rotation_offset)}")
    for name in ("stage_one", "stage_two"):
        position, orientation = getattr(target, name)
        lines.append(f"{name} = {{ position = {position!r}, orientation = {orientation!r} }}")
    return lines


def _numbers(values: np.ndarray) -> str:
    return f"[{', '.join(repr(round(float(value), 8) + 0.0) for value in values)}]"


def _text(value: str) -> str:
    """A basic string of TOML."""
    escaped = "".join(c if c >= " " and c not in '"\\\x7f' else f"\\u{ord(c):04x}" for c in value)
    return f'"{escaped}"'
