"""Faults of the joints: spikes, jumps, the first frames, limits."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from gmr_traj.metrics import joints
from gmr_traj.metrics.artefact import Artefact, Collector
from gmr_traj.metrics.observation import Observation

# Signals slower than this share of the threshold are at rest: the median over stillness is no measure of a jump.
_REST = 0.05


def joint_artefacts(observation: Observation, collector: Collector) -> list[Artefact]:
    """Velocity, jump, transient, acceleration spike and joint limit, each fault under its first cause only.

    Steps of a transient are not reported again as jumps, nor jumps as excess velocity, nor either as an
    acceleration spike.
    """
    motion, robot = observation.motion, observation.robot
    settings = collector.settings
    excess = joints.range_excess(motion, robot)
    found = collector.collect("joint_limit", robot.joint_names, excess, "rad", 1.0)
    if motion.frames < 3:
        return found

    base, turn = joints.base_speeds(motion)  # (T - 1,)
    speed = np.column_stack([np.abs(joints.velocities(motion)), turn, base])  # (T - 1, n + 2)
    level = np.full(speed.shape[1], settings("jump", "report"))
    level[-1] = settings("jump", "base")
    relative = speed / level
    transient = _transient(observation, relative, speed, collector)
    found += transient
    settled = np.arange(len(relative))[:, None] >= max((a.stop - 1 for a in transient), default=0)  # (T - 1, 1)

    window = 2 * collector.frames("merge", "window") + 1
    usual = median_filter(relative, size=(window, 1), mode="nearest")
    jumps = settled & (relative > 1.0) & (relative > settings("jump", "ratio") * np.maximum(usual, _REST))
    names = (*robot.joint_names, "base orientation", "base position")
    units = ["rad/s"] * (len(names) - 1) + ["m/s"]
    for column, (name, unit) in enumerate(zip(names, units, strict=True)):
        own = slice(column, column + 1)
        signal, flagged = _on_frames(relative[:, own]), _on_frames(jumps[:, own])
        # The settings speak of joint speed; the base's is rated by its own threshold.
        rated = signal * settings("jump", "report")
        shown = float(level[column]) / settings("jump", "report")
        found += collector.collect("jump", [name], rated, unit, shown, flagged)

    ratio = np.abs(joints.velocities(motion)) / robot.velocity_limit  # (T - 1, n)
    over = settled & (ratio > settings("velocity", "report")) & ~jumps[:, :-2]
    found += collector.collect("velocity", robot.joint_names, _on_frames(ratio), "of the limit", 1.0, _on_frames(over))

    acceleration = np.abs(joints.accelerations(motion))  # (T - 2, n), of frames 1 to T - 2
    usual = median_filter(acceleration, size=(window, 1), mode="nearest")
    report, times = settings("acceleration_spike", "report"), settings("acceleration_spike", "ratio")
    spikes = settled[:-1] & (acceleration > report) & (acceleration > times * np.maximum(usual, _REST * report))
    reported = _on_frames(jumps[:, :-2] | over)  # (T, n)
    known = reported.copy()
    known[1:] |= reported[:-1]
    known[:-1] |= reported[1:]
    padded = np.pad(acceleration, ((1, 1), (0, 0)))
    flagged = np.pad(spikes, ((1, 1), (0, 0))) & ~known
    return found + collector.collect("acceleration_spike", robot.joint_names, padded, "rad/s^2", 1.0, flagged)


def _transient(
    observation: Observation, relative: np.ndarray, speed: np.ndarray, collector: Collector
) -> list[Artefact]:
    """The first steps, where they are far faster than what follows: the solver was still finding the motion.

    Args:
        observation: the clip.
        relative: speeds of all joints, the base's orientation and position over what a jump needs.  # (T - 1, n + 2)
        speed: the speeds themselves.  # (T - 1, n + 2)
        collector: of the clip.
    """
    settings = collector.settings
    first = collector.frames("transient", "first")
    after = relative[first : first + collector.frames("transient", "typical")].max(axis=1)
    if not after.size:
        return []
    fastest = relative[:first].max(axis=1)
    bar = max(settings("transient", "report"), settings("transient", "ratio") * float(np.median(after)))
    steps = np.flatnonzero(fastest > bar)
    if not steps.size:
        return []
    step = int(fastest.argmax())
    column = int(relative[step].argmax())
    names = (*observation.robot.joint_names, "base orientation", "base position")
    unit, scale = ("m/s" if column == len(names) - 1 else "rad/s"), float(speed[step, column] / relative[step, column])
    value = float(relative[step, column])
    return [collector.artefact("transient", names[column], (0, int(steps[-1]) + 2), step, value, unit, scale)]


def _on_frames(steps: np.ndarray) -> np.ndarray:
    """Values of the steps t -> t+1 (T - 1, n) given to both their frames (T, n), the larger one where two meet."""
    blank = np.zeros((1, steps.shape[1]), dtype=steps.dtype)
    return np.maximum(np.concatenate([steps, blank]), np.concatenate([blank, steps]))
