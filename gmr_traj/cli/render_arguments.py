"""The arguments of `gmr-traj render`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from gmr_traj.cli.arguments import Common, named
from gmr_traj.exceptions import GmrTrajError


@dataclass(frozen=True, kw_only=True)
class Render(Common):
    """Draw clips, without a screen: a still, a film strip over a range of time, or a video.

    What overlaps by more than a millimetre is red.  Clips of different rates are drawn at the same times.
    """

    clips: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="CLIP...", help_behavior_hint="(at least one)"),
    ]
    """Clips of one robot."""

    output: Annotated[Path, tyro.conf.arg(aliases=("-o",), metavar="PNG|MP4")]
    """Picture (.png) or video (.mp4, which needs the extra `video`) to write."""

    time: Annotated[float | None, named("SECONDS", "the worst artefact; the start for a range and for video")] = None
    """Time of a still, or begin of a range."""

    to: Annotated[float | None, named("SECONDS", "a still; the end for video")] = None
    """End of the range."""

    columns: int = 9
    """Pictures in a row of a film strip."""

    size: Annotated[tuple[int, int] | None, named("WIDTH HEIGHT", "320 380; 480 560 for a still and video")] = None
    """Size of each picture [pixels]."""

    azimuth: float = 140.0
    """Direction the camera looks in, from the robot's heading at the first picture [deg]; 180 looks it in the face."""

    elevation: float = -8.0
    """How far the camera looks up [deg]."""

    distance: float = 3.0
    """Of the camera, relative to the height of the standing robot's base."""

    shapes: bool = False
    """Draw collision shapes, also where there are link meshes (extra `meshes`)."""

    speed: float = 1.0
    """Of the motion in a video; 0.25 is slow motion."""

    rate: float = 30.0
    """Pictures per second of a video."""

    as_is: bool = False
    """Leave the clips at their height; otherwise each is raised or lowered, as a whole, to stand on the floor."""

    quiet: bool = False
    """Print nothing but errors."""

    force: bool = False
    """Overwrite a file that exists."""

    def run(self) -> int:
        """Draw the clips."""
        if not self.clips:
            raise GmrTrajError("render needs at least one clip")
        from gmr_traj.cli.render import run

        return run(self)
