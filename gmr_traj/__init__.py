"""gmr-traj: whole-clip trajectory optimisation for humanoid motion retargeting."""

from gmr_traj._version import __version__

__all__ = ["__version__"]
