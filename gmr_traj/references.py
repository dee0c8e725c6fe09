"""Where the bodies of the robot should be: the desired motion a retargeter hands over with its clip."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gmr_traj.exceptions import ClipError


@dataclass(frozen=True)
class BodyTargets:
    """Desired world placements of some bodies, one a frame.

    Attributes:
        names: names of the bodies.  # B
        positions: desired positions of the bodies' points [m], read-only.  # (T, B, 3)
        quaternions: desired orientations, unit, wxyz, read-only.  # (T, B, 4)
        position_weights, orientation_weights: relative importance, 1 is typical, 0 leaves it free.  # (B,)
        points: which point of each body is meant, in the body's frame [m]; its origin where not given.  # (B, 3)

    Raises:
        ClipError: on repeated names, a wrong shape, a value that is not finite, a quaternion that is not of unit
            length (to 1e-3; closer ones are normalised), or a negative weight.
    """

    names: tuple[str, ...]
    positions: np.ndarray
    quaternions: np.ndarray
    position_weights: np.ndarray
    orientation_weights: np.ndarray
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        names = tuple(self.names)
        bodies = len(names)
        if len(set(names)) != bodies:
            raise ClipError(f"references: body {next(n for n in names if names.count(n) > 1)!r} is named twice")
        frames = len(self.positions) if np.ndim(self.positions) else 0
        if not np.size(self.points):
            object.__setattr__(self, "points", np.zeros((bodies, 3)))
        shapes = {
            "positions": (frames, bodies, 3),
            "quaternions": (frames, bodies, 4),
            "position_weights": (bodies,),
            "orientation_weights": (bodies,),
            "points": (bodies, 3),
        }
        for name, shape in shapes.items():
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise ClipError(f"references: {name} has shape {value.shape}; expected {shape}")
            if not np.isfinite(value).all():
                raise ClipError(f"references: {name} has values that are not finite")
            if name.endswith("weights") and (value < 0).any():
                raise ClipError(
                    f"references: {name} of {names[int(value.argmin())]!r} is negative; 0 leaves a body free"
                )
            if name == "quaternions":
                norm = np.linalg.norm(value, axis=-1)
                off = np.argwhere(np.abs(norm - 1.0) > 1e-3)
                if off.size:
                    t, b = off[0]
                    raise ClipError(
                        f"references: frame {t}: quaternion of {names[b]!r} has length {norm[t, b]:.4f}, not 1"
                    )
                value /= norm[..., None]
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "names", names)

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.positions)

    def of(self, bodies: Collection[str]) -> BodyTargets:
        """Those of some bodies."""
        kept = [k for k, name in enumerate(self.names) if name in bodies]
        return replace(
            self,
            names=tuple(self.names[k] for k in kept),
            positions=self.positions[:, kept],
            quaternions=self.quaternions[:, kept],
            position_weights=self.position_weights[kept],
            orientation_weights=self.orientation_weights[kept],
            points=self.points[kept],
        )

    def reached(self, body_names: Sequence[str], positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Where a motion has the points that are meant [m].  # (T, B, 3)

        Args:
            body_names: the robot's bodies, all of these among them.  # N
            positions: their origins in the world [m].  # (T, N, 3)
            rotations: their orientations in the world.  # (T, N, 3, 3)
        """
        slots = [body_names.index(name) for name in self.names]
        return np.asarray(positions[:, slots] + np.einsum("tbij,bj->tbi", rotations[:, slots], self.points))

    def part(self, start: int, stop: int) -> BodyTargets:
        """Frames ``start`` to ``stop``."""
        return replace(self, positions=self.positions[start:stop], quaternions=self.quaternions[start:stop])

    def raised(self, height: float) -> BodyTargets:
        """All positions higher by ``height`` [m]."""
        return replace(self, positions=self.positions + np.array([0.0, 0.0, height]))
