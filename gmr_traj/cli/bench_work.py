"""What `gmr-traj bench` measures, each in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from gmr_traj.bench.engine import with_engine
from gmr_traj.bench.figures import Outcome
from gmr_traj.bench.fresh import Moment, Prepared
from gmr_traj.bench.gmr_loop import gmr_loop
from gmr_traj.bench.lengths import clip_of_length, human_of_length
from gmr_traj.cli.bench_arguments import Bench, Measure
from gmr_traj.cli.human_input import Start, retargeted_clip
from gmr_traj.cli.human_options import about
from gmr_traj.cli.loading import load
from gmr_traj.cli.refine import solve
from gmr_traj.formats import write_clip
from gmr_traj.formats.clip import SUFFIXES
from gmr_traj.human_motion import HumanMotion
from gmr_traj.kinematics.casadi_kinematics import CasadiKinematics
from gmr_traj.problem import Problem, load_problem
from gmr_traj.refine import Refinement
from gmr_traj.retarget.body_map import BodyMap
from gmr_traj.retarget.retarget import retarget
from gmr_traj.retarget.targets import scaled_targets
from gmr_traj.robot import Robot
from gmr_traj.robot_loading import load_robot


@dataclass(frozen=True)
class Measured:
    """One thing to measure.

    Attributes:
        arguments: of the command.
        clip: the clip.
        human: whether it is a human motion.
        what: to measure.
        engine: to refine with; None for the problem as it is.
        frames: to make the clip as long as; None for its own.
    """

    arguments: Bench
    clip: Path
    human: bool
    what: Measure
    engine: str | None = None
    frames: int | None = None

    @property
    def name(self) -> str:
        """What it is called in tables."""
        return f"{self.what} {self.engine}" if self.engine else self.what

    def prepare(self) -> Prepared:
        """Load, and make what is needed.

        Raises:
            GmrTrajError: the clip cannot be read, retargeted or refined with these arguments.
        """
        if self.what in ("gmr-loop", "gmr-loop-lean"):
            return self._loop()
        if self.what == "retarget":
            human, robot, body_map = self.person()
            return Prepared(partial(self.retarget, human, robot, body_map), Moment.now())
        return self._refine() if self.what == "refine" else self._end_to_end()

    def person(self) -> tuple[HumanMotion, Robot, BodyMap]:
        """Read the human motion, and what it is retargeted with.

        Raises:
            GmrTrajError: it cannot be read, or there is no map for it.
        """
        robot = load_robot(self.arguments.robot)
        human = self.arguments.read_human(self.clip, self.arguments.fps)
        return human, robot, self.arguments.load_map(human, self.clip, robot)

    def _loop(self) -> Prepared:
        human, robot, body_map = self.person()
        with about(self.clip):
            targets = scaled_targets(human, body_map)

        def action() -> Outcome:
            loop = gmr_loop(robot, body_map, targets, published=self.what == "gmr-loop")
            return Outcome(targets.frames, loop.steps / targets.frames)

        return Prepared(action, Moment.now())

    def retarget(self, human: HumanMotion, robot: Robot, body_map: BodyMap) -> Outcome:
        """Retarget a human motion."""
        with about(self.clip):
            result = retarget(human, robot, body_map, method=self.arguments.method)
        return Outcome(human.frames, result.steps / human.frames)

    def _refine(self) -> Prepared:
        problem = self._problem()
        if self.human:
            human, robot, body_map = self.person()
            loaded = Moment.now()
            if self.frames is not None:
                human = human_of_length(human, self.frames)
            begun = self._retargeted(human, robot, body_map)
        else:
            clip, robot = load(self.clip, self.arguments)
            loaded = Moment.now()
            begun = Start(clip if self.frames is None else clip_of_length(clip, self.frames), robot)
        return Prepared(self._refining(begun, problem, CasadiKinematics(robot)), loaded)

    def _end_to_end(self) -> Prepared:
        problem, robot = self._problem(), load_robot(self.arguments.robot)
        kinematics = CasadiKinematics(robot)
        file_format = self.arguments.format or "gmr-traj"

        def action() -> Outcome:
            human = self.arguments.read_human(self.clip, self.arguments.fps)
            begun = self._retargeted(human, robot, self.arguments.load_map(human, self.clip, robot))
            refinement = self._solve(begun, problem, kinematics)
            with TemporaryDirectory() as folder:
                clip = begun.clip.with_motion(refinement.motion, refinement.schedule)
                write_clip(clip, Path(folder) / f"clip{SUFFIXES[file_format]}", format=file_format, robot=robot)
            return _outcome(human.frames, refinement)

        return Prepared(action, Moment.now())

    def _problem(self) -> Problem:
        problem = load_problem(self.arguments.problem)
        return problem if self.engine is None else with_engine(problem, self.engine)

    def _retargeted(self, human: HumanMotion, robot: Robot, body_map: BodyMap) -> Start:
        with about(self.clip):
            result = retarget(human, robot, body_map, method=self.arguments.method)
        return Start(*retargeted_clip(human, result, robot, body_map, self.clip))

    def _refining(self, begun: Start, problem: Problem, kinematics: CasadiKinematics) -> Callable[[], Outcome]:
        return lambda: _outcome(begun.clip.motion.frames, self._solve(begun, problem, kinematics))

    def _solve(self, begun: Start, problem: Problem, kinematics: CasadiKinematics) -> Refinement:
        return solve(begun, begun.clip.schedule, self.arguments, problem, kinematics=kinematics)


@dataclass(frozen=True)
class FirstUse:
    """Gives the C compiler, where there is one, what it has to make for a motion: to be done before all measurements.

    Attributes:
        measured: the motion's retargeting.
    """

    measured: Measured

    def prepare(self) -> Prepared:
        """Load; the action retargets one frame.

        Raises:
            GmrTrajError: the motion cannot be read or retargeted with these arguments.
        """
        human, robot, body_map = self.measured.person()
        return Prepared(partial(self.measured.retarget, human_of_length(human, 1), robot, body_map), Moment.now())


def _outcome(frames: int, refinement: Refinement) -> Outcome:
    report = refinement.report
    return Outcome(frames, report.iterations, report.status, report.evaluation_seconds, report.linear_seconds)
