"""How well a rollout followed its reference, and when it stopped doing so."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gmr_traj.kinematics.mujoco_kinematics import placements
from gmr_traj.robot import Robot

HEIGHT = 0.25  # [m] of the anchor body (and of hands and feet in the full rule) away from the reference
GRAVITY_Z = 0.8  # [-] difference of the anchor's projected gravity along its own z axis


@dataclass(frozen=True)
class Tracking:
    """One rollout against one reference.  Errors are means over the moments before the fall.

    Attributes:
        success: it reached the end by the paper's rule: the anchor body's height stays within 0.25 m of the reference
            and its projected gravity z within 0.8.
        success_full: the same with BeyondMimic's full rule: hands and feet within 0.25 m of their height as well.
        fell: seconds after the start when the paper's rule was broken; None where it was not.
        reason: which rule broke first, and by how much; empty where none did.
        alive: seconds that were followed.
        length: seconds that were asked for.
        g_mpbpe: E_g-mpbpe, mean over key bodies of their distance in the world [mm].
        mpbpe: E_mpbpe, the same relative to the base's position [mm].
        mpjpe: E_mpjpe, mean over joints of the absolute angle [1e-3 rad].
        mpjpe_norm: norm over joints of the angles [1e-3 rad], which the paper's figures are closer to.
        saturated: share of the moments in which a motor was at its effort limit.
        over_speed: share of the moments in which a joint was above its velocity limit.
    """

    success: bool
    success_full: bool
    fell: float | None
    reason: str
    alive: float
    length: float
    g_mpbpe: float
    mpbpe: float
    mpjpe: float
    mpjpe_norm: float
    saturated: float
    over_speed: float

    def to_json(self) -> dict[str, Any]:
        """The figures by name."""
        return asdict(self)


class Rules:
    """The rules by which a rollout counts as fallen.

    Args:
        robot: the robot; its hands and feet are the key bodies on which no other key body hangs.
    """

    def __init__(self, robot: Robot) -> None:
        index = {name: i for i, name in enumerate(robot.body_names)}
        self.anchor = index[robot.anchor_body]
        self.ends = [index[name] for name in _ends(robot)]

    def broken(self, positions: np.ndarray, rotations: np.ndarray, goals: np.ndarray, turns: np.ndarray) -> str:
        """The paper's rule that bodies (B, 3), (B, 3, 3) break against their goals; empty where they keep them."""
        height = float(abs(positions[self.anchor, 2] - goals[self.anchor, 2]))
        gravity = float(abs(rotations[self.anchor, 2, 2] - turns[self.anchor, 2, 2]))
        if not np.isfinite(height + gravity):
            return "the simulation diverged"
        if height > HEIGHT:
            return f"anchor height off by {height:.2f} m"
        if gravity > GRAVITY_Z:
            return f"anchor's projected gravity off by {gravity:.2f}"
        return ""

    def ends_broken(self, positions: np.ndarray, goals: np.ndarray) -> np.ndarray:
        """Whether a hand or foot is too high or low, in every frame, (T,)."""
        off = np.abs(positions[:, self.ends, 2] - goals[:, self.ends, 2]) > HEIGHT
        return np.asarray(off.any(axis=1))


def tracking(
    robot: Robot,
    qpos: np.ndarray,
    wanted: np.ndarray,
    *,
    tick: float,
    ticks: int,
    reason: str,
    saturated: np.ndarray,
    over_speed: np.ndarray,
) -> Tracking:
    """Figures of a rollout.

    Args:
        robot: the robot.
        qpos: configurations at the control ticks before the fall, the first included.  # (T, 7 + n)
        wanted: the reference at the same moments.  # (T, 7 + n)
        tick: time between them [s].
        ticks: how many there would be without a fall.
        reason: why the rollout stopped; empty where it reached the end.
        saturated: whether a motor was at its effort limit in the tick before each moment.  # (T,)
        over_speed: whether a joint was above its velocity limit there.  # (T,)
    """
    positions, _ = placements(robot, qpos)
    goals, _ = placements(robot, wanted)
    key = [robot.body_names.index(body.body) for body in robot.key_bodies]
    off = positions - goals
    relative = off - off[:, :1]  # the base is the first body
    joints = qpos[:, 7:] - wanted[:, 7:]
    full = not reason and not Rules(robot).ends_broken(positions, goals).any()
    alive = (len(qpos) - 1) * tick
    return Tracking(
        success=not reason,
        success_full=bool(full),
        fell=alive + tick if reason else None,
        reason=reason,
        alive=alive,
        length=(ticks - 1) * tick,
        g_mpbpe=1e3 * float(np.linalg.norm(off[:, key], axis=2).mean()),
        mpbpe=1e3 * float(np.linalg.norm(relative[:, key], axis=2).mean()),
        mpjpe=1e3 * float(np.abs(joints).mean()),
        mpjpe_norm=1e3 * float(np.linalg.norm(joints, axis=1).mean()),
        saturated=float(saturated.mean()),
        over_speed=float(over_speed.mean()),
    )


def _ends(robot: Robot) -> list[str]:
    """Key bodies on which no other key body hangs."""
    model = robot.model
    key = {model.body(body.body).id for body in robot.key_bodies}
    inner: set[int] = set()
    for body in key:
        parent = int(model.body_parentid[body])
        while parent > 0:
            inner.add(parent)
            parent = int(model.body_parentid[parent])
    return [model.body(body).name for body in sorted(key - inner)]
