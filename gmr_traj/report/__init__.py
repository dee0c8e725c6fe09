"""One page of HTML about a clip and its refinement."""

from gmr_traj.report.page import Illustration, page

__all__ = ["Illustration", "page"]
