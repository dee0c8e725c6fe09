"""Frames before and after a clip that lead from the robot's default standing posture into it, and out of it again."""

from gmr_traj.lead.extend import Added, Extended, Leads, extend

__all__ = ["Added", "Extended", "Leads", "extend"]
