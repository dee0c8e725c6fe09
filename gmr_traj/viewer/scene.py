"""What one recording shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gmr_traj import colours
from gmr_traj.exceptions import ClipError
from gmr_traj.human_motion import HumanMotion
from gmr_traj.metrics.artefact import Artefact
from gmr_traj.metrics.certificate import Certificate
from gmr_traj.references import BodyTargets
from gmr_traj.track import Track
from gmr_traj.viewer.paths import part

MARGIN = 0.6  # before and after what a recording opens with [s]
LONGEST = 1.0  # how much of a long artefact is taken before and after its peak [s]


@dataclass(frozen=True)
class Scene:
    """Clips in one world on one clock, and what is known about them.

    Attributes:
        title: name of the recording.
        tracks: the clips, the one to look at for faults first: ``raw``, ``refined``, then e.g. a ``rollout``.
        certificate: of the refinement, where it is one.
        trace: Ipopt's objective and infeasibilities by iteration, where known.
        human: the person the motion came from.
        targets: where the robot's bodies were meant to be, on the same floor, in frames of the first clip.
        focus: time the recording opens at [s]; None for the worst artefact.

    Raises:
        ClipError: no clips, two of one name, or targets with another number of frames than the first clip.
    """

    title: str
    tracks: tuple[Track, ...]
    certificate: Certificate | None = None
    trace: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    human: HumanMotion | None = None
    targets: BodyTargets | None = None
    focus: float | None = None

    def __post_init__(self) -> None:
        names = [part(track.name) for track in self.tracks]
        if not names:
            raise ClipError("there is no clip to show")
        if len(set(names)) < len(names):
            raise ClipError(f"two clips are called {next(n for n in names if names.count(n) > 1)!r}")
        frames = self.tracks[0].motion.frames
        if self.targets is not None and self.targets.frames != frames:
            raise ClipError(f"the targets have {self.targets.frames} frames, the clip {frames}")

    @property
    def fps(self) -> float:
        """Frames per second of the timeline ``frame``: the first clip's."""
        return self.tracks[0].motion.fps

    @property
    def seconds(self) -> float:
        """Length of the longest clip [s]."""
        return max(track.motion.duration for track in self.tracks)

    def colour(self, track: Track) -> colours.RGB:
        """Colour of one of the clips."""
        return colours.role(track.name, self.tracks.index(track))

    def worst(self) -> Artefact | None:
        """The artefact of the first clip that the recording opens at."""
        return self.tracks[0].worst(self.focus)

    @property
    def opens_at(self) -> float:
        """What the recording opens at [s]: the focus, else the peak of the worst artefact, else the start."""
        if self.focus is not None:
            return self.focus
        worst = self.worst()
        return 0.0 if worst is None else worst.peak / self.fps

    @property
    def highlight(self) -> tuple[float, float] | None:
        """Begin and end [s] of what the recording opens with, in a loop; None where there is nothing to point at."""
        worst = self.worst()
        if self.focus is None and worst is None:
            return None
        begin = end = self.opens_at
        if worst is not None:
            begin, end = min(begin, max(worst.begin, begin - LONGEST)), max(end, min(worst.end, end + LONGEST))
        return max(0.0, begin - MARGIN), min(self.seconds, end + MARGIN)
