"""The batch as a whole: every clip by what still falls short, and totals."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj import atomic
from gmr_traj.batch.records import Record

SUMMARY = "summary.jsonl"
TOTALS = "totals.json"
# The figures whose sum or extreme over the clips says what a batch has done.
_SUMMED = ("over_frames", "limit_frames", "jumps")
_LARGEST = ("speed_ratio", "drift_p95", "drift_max", "slide_mean", "float_p95", "self_depth")
_LEAST = ("sole_lowest", "floor_lowest")
_NO_NUMBER = 1e9  # share of its bar of a promise whose value is none: as bad as can be


@dataclass(frozen=True)
class Shortfall:
    """How far a clip is from what it should be.

    Attributes:
        failed: whether there is no clip.
        broken: how many promises are broken, faults of the audit and fallen rollouts included.
        share: of its bar that the worst promise uses: above 1 it is broken.
        sentence: the worst promise.
        value, bar, before: its figures; None where there is none.
        unit, where: of the value.
    """

    failed: bool = False
    broken: int = 0
    share: float = 0.0
    sentence: str = ""
    value: float | None = None
    bar: float | None = None
    before: float | None = None
    unit: str = ""
    where: str = ""

    @property
    def rank(self) -> tuple[bool, int, float]:
        """Larger is worse."""
        return self.failed, self.broken, self.share


def shortfall(record: Record) -> Shortfall:
    """How far the clip of a record is from what it should be."""
    if record["status"] == "failed":
        return Shortfall(failed=True, sentence=str(record["reason"]))
    promises: Sequence[Mapping[str, Any]] = record.get("certificate", {}).get("promises", ())
    verified = record.get("verify")
    faults = [] if verified is None else _faults(verified)
    broken = sum(not promise["held"] for promise in promises) + len(faults)
    if not promises:
        return Shortfall(
            broken=broken, share=1.0 + len(faults) if faults else 0.0, sentence=faults[0] if faults else ""
        )
    worst = max(promises, key=_share)
    if faults and worst["held"]:
        return Shortfall(broken=broken, share=1.0 + len(faults), sentence=faults[0])
    keys = ("sentence", "value", "bar", "before", "unit", "where")
    return Shortfall(broken=broken, share=_share(worst), **{key: worst[key] for key in keys})


def ranked(records: Mapping[str, Record]) -> list[tuple[str, Record, Shortfall]]:
    """The clips with their shortfalls, what falls short most first, then by name."""
    rows = [(name, record, shortfall(record)) for name, record in sorted(records.items())]
    return sorted(rows, key=lambda row: row[2].rank, reverse=True)


def line(name: str, record: Record, short: Shortfall) -> dict[str, Any]:
    """One clip's line of the summary."""
    certificate = record.get("certificate", {})
    verified = record.get("verify")
    return {
        "clip": name,
        "input": record["input"]["path"],
        "outputs": {what: output["file"] for what, output in record["outputs"].items()},
        "status": record["status"],
        "reason": record["reason"],
        "broken": [promise["name"] for promise in certificate.get("promises", ()) if not promise["held"]],
        "worst": short.sentence,
        "share_of_bar": short.share,
        "solver": record.get("solver", {}).get("status"),
        "iterations": record.get("solver", {}).get("iterations"),
        "followed": None if verified is None else verified["passed"],
        "before": certificate.get("before"),
        "after": certificate.get("after", record.get("figures")),
        "audit": None if verified is None else verified["audit"]["summary"],
    }


def totals(records: Iterable[Record]) -> dict[str, Any]:
    """Counts, seconds of motion, and of some figures the sum or the extreme over the clips before and after."""
    known = list(records)
    done = [record for record in known if record["status"] == "done"]
    certificates = [record["certificate"] for record in done if "certificate" in record]
    verified = [record["verify"] for record in done if "verify" in record]
    figures = [c["after"] for c in certificates] + [r["figures"] for r in done if "figures" in r]
    out: dict[str, Any] = {
        "clips": len(known),
        "done": len(done),
        "failed": len(known) - len(done),
        "held": sum(certificate["held"] for certificate in certificates),
        "broken": sum(not certificate["held"] for certificate in certificates),
        "followed": sum(entry["passed"] for entry in verified),
        "not_followed": sum(not entry["passed"] for entry in verified),
        "frames": sum(entry["frames"] for entry in figures),
        "seconds_of_motion": round(sum(entry["seconds"] for entry in figures), 6),
    }
    for stage in ("before", "after"):
        entries = [certificate[stage] for certificate in certificates]
        if entries:
            out[stage] = {
                **{name: int(sum(entry[name] for entry in entries)) for name in _SUMMED},
                **{f"{name}_median": float(np.median([entry[name] for entry in entries])) for name in _LARGEST},
                **{f"{name}_max": max(entry[name] for entry in entries) for name in _LARGEST},
                **{f"{name}_min": min(entry[name] for entry in entries) for name in _LEAST},
            }
    return out


def write_summary(out: Path, records: Mapping[str, Record]) -> None:
    """Write ``summary.jsonl``, one line a clip, ranked, and ``totals.json``; equal records give equal bytes."""
    with atomic.write(out / SUMMARY) as stream:
        for row in ranked(records):
            stream.write(json.dumps(line(*row), allow_nan=False).encode() + b"\n")
    with atomic.write(out / TOTALS) as stream:
        stream.write(json.dumps(totals(records.values()), indent=2, allow_nan=False).encode() + b"\n")


def _share(promise: Mapping[str, Any]) -> float:
    """The value over its bar; where the bar is zero, anything above it is broken by that much."""
    value, bar = promise["value"], promise["bar"]
    if value is None:  # it was not a number
        return _NO_NUMBER
    if bar > 0:
        return float(value / bar)
    return float(1.0 + value - bar) if value > bar else 0.0


def _faults(verified: Mapping[str, Any]) -> list[str]:
    fallen = [
        f"a rollout under {entry['conditions']} from frame {entry['start_frame']} fell"
        for entry in verified["rollouts"]
        if entry["success"] < 1.0
    ]
    return [*verified["audit"]["failures"], *fallen]
