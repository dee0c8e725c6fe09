"""What is to be solved: the motions and the schedule of a run of frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gmr_traj.contacts.schedule import ContactSchedule
from gmr_traj.motion import RobotMotion
from gmr_traj.references import BodyTargets
from gmr_traj.visited import Visited

# Frames that are held at a seam: three carry position, velocity and acceleration across it.
HELD = 3


@dataclass(frozen=True)
class Task:
    """Motions and schedule of the frames to solve for.

    Attributes:
        centre: motion to start from.
        target: motion to stay close to.
        trust: of each frame of the target.  # (T,)
        schedule: stances.
        references: the source's targets, fitted to the robot; None where they are not known.
        held: frames that keep the centre's configuration.
        visited: motions of earlier passes near which constraint rows are built, the centre's apart.
    """

    centre: RobotMotion
    target: RobotMotion
    trust: np.ndarray
    schedule: ContactSchedule
    held: np.ndarray
    visited: tuple[Visited, ...] = ()
    references: BodyTargets | None = None

    def part(self, centre: RobotMotion, start: int, stop: int, held: np.ndarray) -> Task:
        """Frames ``start`` to ``stop`` about another motion of the whole clip; ``held`` counts from ``start``."""
        stances = tuple(
            replace(stance, start=max(stance.start, start) - start, stop=min(stance.stop, stop) - start)
            for stance in self.schedule.stances
            if stance.start < stop and stance.stop > start
        )

        def cut(motion: RobotMotion) -> RobotMotion:
            return motion.with_qpos(motion.qpos[start:stop])

        return Task(
            centre=cut(centre),
            target=cut(self.target),
            trust=self.trust[start:stop],
            schedule=replace(self.schedule, frames=stop - start, stances=stances),
            held=held,
            visited=tuple(visited.part(start, stop) for visited in self.visited),
            references=None if self.references is None else self.references.part(start, stop),
        )
