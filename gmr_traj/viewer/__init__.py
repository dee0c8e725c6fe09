"""Recordings for the rerun viewer: clips before and after, with everything that is measured about them.

rerun is imported inside the functions that need it: it takes half a second, and only recordings use it.
"""

from gmr_traj.viewer.recording import save
from gmr_traj.viewer.scene import Scene

__all__ = ["Scene", "save"]
