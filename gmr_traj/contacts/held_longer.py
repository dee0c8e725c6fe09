"""Which points stand when, and how far they would be from where they stand if they did so in other frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

# A stance may hold frames of the detected kind that are this much farther from its place than added ones may be.
_DETECTED = 1.5
# A foot that is turned by more than this within a stance that was prolonged is turning about one point of it [rad].
_TURNED = 0.35


class Standing:
    """Stances of points, to be prolonged and added to; no addition moves a point farther than ``farthest``.

    Args:
        resting: which point is in stance when; changed in place.  # (T, K) bool
        points: the points in the world [m].  # (T, K, 3)
        height: above the floor they rest on [m].  # (T, K)
        headings: of the foot that each point belongs to, about the vertical [rad].  # (T, K)
        groups: points that move as one (the toe of a foot, its heel).
        farthest: largest distance of a point from where it stands in frames that are added [m].
    """

    def __init__(
        self,
        resting: np.ndarray,
        points: np.ndarray,
        height: np.ndarray,
        headings: np.ndarray,
        groups: Sequence[Sequence[int]],
        farthest: float,
    ) -> None:
        self.resting = resting
        self.height = height
        self.farthest = farthest
        self._points = points
        self._headings = headings
        self._groups = groups

    def add(self, members: Sequence[int], start: int, stop: int) -> bool:
        """Put points in stance, unless that joins stances in places too far from each other; whether it was done.

        Where the foot turns meanwhile, only the one of the points that moves least: the foot turns about it, and two
        points that stand would not let it.
        """
        spans: list[tuple[float, int, int, int]] = []
        turns = False
        for k in members:
            first, last = self.run(k, start, stop)
            places, was = self._points[first:last, k, :2], self.resting[first:last, k]
            known = was if was.any() else np.ones(len(places), bool)
            away = np.linalg.norm(places - places[known].mean(axis=0), axis=1)
            bar = np.where(was, _DETECTED, 1.0) * self.farthest
            if (away > bar).any():
                return False
            facing = np.exp(1j * self._headings[first:last, k])
            turn = np.abs(np.angle(facing * facing[known].mean().conj()))
            turns = turns or bool((turn[~was] > _TURNED).any())
            spans.append((float(away[~was].max(initial=0.0)), k, first, last))
        for _, k, first, last in sorted(spans)[: 1 if turns else None]:
            self.resting[first:last, k] = True
        return True

    def near(self, k: int, start: int, stop: int) -> tuple[int, int]:
        """The frames around its slowest one, within ``[start, stop)``, in which a point is near its place there."""
        place = self._points[start:stop, k, :2]
        slowest = int(np.linalg.norm(np.diff(place, axis=0), axis=1).argmin())
        away = np.flatnonzero(np.linalg.norm(place - place[slowest], axis=1) > self.farthest)
        before, after = away[away < slowest], away[away > slowest]
        return (
            start + (int(before[-1]) + 1 if before.size else 0),
            start + int(after[0]) if after.size else stop,
        )

    def neighbours(self, first: int, last: int, edge: int, side: int) -> tuple[list[int], np.ndarray]:
        """The group whose points stand at one edge of a gap and stay nearest in it, and its distances [m].  # (T,)

        Args:
            first: frame of the gap.
            last: frame of the gap.
            edge: which of them.
            side: -1 for the stance before it, 1 for the one after it.

        Returns:
            The group's standing points, and their largest distance in the gap and the frames next to it, infinity in
            all others  # (T,); no points, and infinity, without a group.
        """
        best: list[int] = []
        distances = np.full(len(self.resting), np.inf)
        around = slice(max(0, first - 1), last + 2)
        for group in self._groups:
            members = [k for k in group if self.resting[max(0, edge - 1) : edge + 2, k].any()]
            far = np.zeros(len(self.resting[around]))
            for k in members:
                stood = np.flatnonzero(self.resting[:, k])
                stood = stood[stood <= edge] if side < 0 else stood[stood >= edge]
                if not stood.size:
                    members = []
                    break
                far = np.maximum(far, self._from_place(k, int(stood[-1] if side < 0 else stood[0]), around))
            own = far[first - around.start :][: last + 1 - first]
            if members and own.min() < distances[first : last + 1].min():
                best, distances[around] = members, far
        return best, distances

    def away(self, members: Sequence[int], edge: int, frame: int) -> float:
        """Largest distance in a frame from where points stand in the stance that has the frame ``edge`` [m]."""
        if not 0 <= frame < len(self.resting):
            return float("inf")
        return max(float(self._from_place(k, edge, slice(frame, frame + 1))[0]) for k in members)

    def changes(self, able: np.ndarray, reach: int) -> Iterator[tuple[list[int], int, list[int], int]]:
        """Where one group's stance ends about when another's begins, and nothing else bears throughout.

        Args:
            able: which points can bear a load.  # (T, K) bool
            reach: frames that still count as about then.

        Yields:
            Points that end, their last frame, points that begin, their first frame.
        """
        columns = np.arange(self.resting.shape[1])
        on = [self.resting[:, list(group)].any(axis=1).astype(int) for group in self._groups]
        for a, ending in enumerate(self._groups):
            for last in np.flatnonzero(np.diff(on[a]) == -1).tolist():
                others = np.setdiff1d(columns, ending)
                if able[max(0, last - 1) : last + 3, others].all(axis=0).any():
                    continue
                for b, coming in enumerate(self._groups):
                    for first in (np.flatnonzero(np.diff(on[b]) == 1) + 1).tolist():
                        if b != a and abs(first - last) <= reach:
                            yield (
                                [k for k in ending if self.resting[last, k]],
                                last,
                                [k for k in coming if self.resting[first, k]],
                                first,
                            )

    def run(self, k: int, start: int, stop: int) -> tuple[int, int]:
        """The stance that a point would have with frames ``[start, stop)`` added."""
        on = self.resting[:, k]
        while start > 0 and on[start - 1]:
            start -= 1
        while stop < len(on) and on[stop]:
            stop += 1
        return start, stop

    def _from_place(self, k: int, frame: int, around: slice) -> np.ndarray:
        """Distance of a point, in some frames, from its place in the stance around ``frame`` [m].  # (F,)"""
        first, last = self.run(k, frame, frame + 1)
        place = self._points[first:last, k, :2].mean(axis=0)
        off = np.linalg.norm(self._points[around, k, :2] - place, axis=1)
        return np.asarray(np.hypot(off, np.maximum(0.0, self.height[around, k])))
