"""Pictures and video of clips by MuJoCo, without a screen."""

from gmr_traj.render.look import Look
from gmr_traj.render.painter import Painter
from gmr_traj.render.sheet import sheet, to_png

__all__ = ["Look", "Painter", "sheet", "to_png"]
