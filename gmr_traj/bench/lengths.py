"""Clips made shorter, or longer by playing them forth and back, so that nothing jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gmr_traj.formats.clip import Clip
from gmr_traj.human_motion import HumanMotion


def forth_and_back(frames: int, wanted: int) -> np.ndarray:
    """Which frames of a clip to show one after the other: forth, back, forth...  # (wanted,)"""
    period = 2 * (frames - 1)
    phase = np.arange(wanted) % max(period, 1)
    return np.where(phase < frames, phase, period - phase)


def clip_of_length(clip: Clip, wanted: int) -> Clip:
    """A robot's clip of ``wanted`` frames; its contact schedule is lost where that is another length."""
    if wanted == clip.motion.frames:
        return clip
    shown = forth_and_back(clip.motion.frames, wanted)
    references = clip.references
    if references is not None:
        references = replace(
            references, positions=references.positions[shown], quaternions=references.quaternions[shown]
        )
    return replace(clip, motion=clip.motion.with_qpos(clip.motion.qpos[shown]), schedule=None, references=references)


def human_of_length(human: HumanMotion, wanted: int) -> HumanMotion:
    """A human motion of ``wanted`` frames."""
    shown = forth_and_back(human.frames, wanted)
    return replace(
        human,
        positions=human.positions[shown],
        quaternions=human.quaternions[shown],
        contacts={joint: np.asarray(touching)[shown] for joint, touching in human.contacts.items()},
    )
