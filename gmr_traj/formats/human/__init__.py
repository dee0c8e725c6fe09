"""Human motion files of this field, in."""

from gmr_traj.formats.human.neutral_npz import write_human_npz
from gmr_traj.formats.human.reading import is_human, read_human

__all__ = ["is_human", "read_human", "write_human_npz"]
