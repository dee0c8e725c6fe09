"""Motion files of this field, in and out."""

from gmr_traj.formats.clip import FORMATS, Clip
from gmr_traj.formats.reading import read_clip
from gmr_traj.formats.writing import write_clip

__all__ = ["FORMATS", "Clip", "read_clip", "write_clip"]
