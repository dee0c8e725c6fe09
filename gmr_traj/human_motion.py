"""A human motion: where the joints of a person are, frame by frame, whatever file it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gmr_traj.exceptions import ClipError


@dataclass(frozen=True)
class HumanMotion:
    """World placements of a person's joints, Z up, at a constant frame rate.

    Attributes:
        rig: what names and joint frames mean, e.g. ``lafan1``, ``xsens``, ``cmu``, ``smplx``, ``smpl``, ``deepmimic``;
            a body map is made for a rig.
        names: names of the joints, as in the file; the first is the root.  # J
        parents: index of each joint's parent, -1 for the root; parents come before their children.  # (J,)
        positions: joint positions [m], read-only.  # (T, J, 3)
        quaternions: joint orientations in the world, unit, wxyz, read-only.  # (T, J, 4)
        fps: frames per second [Hz].
        height: how tall the person is, standing upright [m].
        contacts: what the file says of contacts: joint name -> whether it is in contact.  # (T,) each
        notes: what was decided on reading and why, one sentence each.

    Raises:
        ClipError: no frames, wrong shapes, values that are not finite, quaternions that are not of unit length (to
            1e-3; closer ones are normalised), repeated names, parents out of order, a frame rate or height that is
            not positive.
    """

    rig: str
    names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: np.ndarray
    quaternions: np.ndarray
    fps: float
    height: float
    contacts: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        joints = len(self.names)
        if len(set(self.names)) != joints:
            raise ClipError(f"joint {next(n for n in self.names if self.names.count(n) > 1)!r} is named twice")
        if len(self.parents) != joints or any(not -1 <= p < k for k, p in enumerate(self.parents)):
            raise ClipError("parents must be one index a joint, -1 or that of an earlier joint")
        frames = len(self.positions)
        if not frames:
            raise ClipError("the motion has no frames")
        for name, size in (("positions", 3), ("quaternions", 4)):
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != (frames, joints, size):
                raise ClipError(f"{name} has shape {value.shape}; expected {(frames, joints, size)}")
            bad = np.argwhere(~np.isfinite(value).all(axis=-1))
            if bad.size:
                t, j = bad[0]
                raise ClipError(f"frame {t}: {name} of {self.names[j]!r} are not finite")
            if name == "quaternions":
                norm = np.linalg.norm(value, axis=-1)
                off = np.argwhere(np.abs(norm - 1.0) > 1e-3)
                if off.size:
                    t, j = off[0]
                    raise ClipError(f"frame {t}: quaternion of {self.names[j]!r} has length {norm[t, j]:.4f}, not 1")
                value /= norm[..., None]
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        for name, unit in (("fps", "frames per second"), ("height", "m")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ClipError(f"{name} is {value:g} {unit}; expected a positive number")
        for joint, touching in self.contacts.items():
            if joint not in self.names or np.shape(touching) != (frames,):
                raise ClipError(f"contacts of {joint!r}: expected a joint of the motion and {frames} values")

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.positions)

    def index(self, name: str) -> int:
        """Place of a joint among the names.

        Raises:
            ClipError: there is no such joint; the message lists those there are.
        """
        if name not in self.names:
            raise ClipError(f"the motion has no joint {name!r}; it has {', '.join(self.names)}")
        return self.names.index(name)
