"""Several retargets of one motion side by side: the same stances, the same seconds, the same figures."""

from gmr_traj.comparison.compare import Comparison, compare
from gmr_traj.comparison.entrant import Entrant
from gmr_traj.comparison.metric import Measure, Metric
from gmr_traj.retarget.source import Source, as_source

__all__ = ["Comparison", "Entrant", "Measure", "Metric", "Source", "as_source", "compare"]
