"""The terms a problem file can name."""

from __future__ import annotations

from gmr_traj.terms.contact_rows import ContactRows
from gmr_traj.terms.contact_wrench import ContactWrench
from gmr_traj.terms.ground import Ground
from gmr_traj.terms.limits import JointAcceleration, JointPosition, JointVelocity
from gmr_traj.terms.posture import Posture
from gmr_traj.terms.self_collision import SelfCollision
from gmr_traj.terms.smoothness import Acceleration, Jerk, Velocity
from gmr_traj.terms.stance import StanceAnchor
from gmr_traj.terms.term import Term
from gmr_traj.terms.tracking import Tracking

#: Name in a problem file -> class.
TERMS: dict[str, type[Term]] = {
    "tracking": Tracking,
    "posture": Posture,
    "velocity": Velocity,
    "acceleration": Acceleration,
    "jerk": Jerk,
    "stance_anchor": StanceAnchor,
    "contact_wrench": ContactWrench,
    "ground": Ground,
    "self_collision": SelfCollision,
    "joint_position": JointPosition,
    "joint_velocity": JointVelocity,
    "joint_acceleration": JointAcceleration,
}

#: Those that are of another class where they are used as a constraint, hard or soft.
CONSTRAINTS: dict[str, type[Term]] = {"contact_wrench": ContactRows}
