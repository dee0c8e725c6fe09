"""The texts of a recording, as markdown: what one sees, the worst artefacts, the certificate."""

from __future__ import annotations

from gmr_traj.metrics.certificate import Certificate
from gmr_traj.text import number
from gmr_traj.track import Track
from gmr_traj.viewer.scene import Scene

LISTED_FIRST, LISTED = 8, 100  # artefacts on the first page, in the full list


def guide(scene: Scene) -> str:
    """What is shown where, in the words of someone who sees it for the first time, and where to look first."""
    lines = []
    for track in scene.tracks:
        motion, count = track.motion, len(track.artefacts)
        lines.append(
            f"- **{track.name}**: {motion.frames} frames at {motion.fps:g} Hz ({motion.duration:.1f} s)"
            f"{_raised(track)}, {count or 'no'} artefact{'' if count == 1 else 's'}"
        )
    if scene.highlight is not None:
        begin, end = scene.highlight
        lines += [
            "",
            f"It opens with {begin:.1f} to {end:.1f} s in a loop, at a quarter of the speed: {_what(scene)}. For the "
            "whole clip choose the timeline `time` below, instead of `highlight`.",
        ]
    lines += [
        "",
        "Space plays and stops; click in a plot or a lane to go there. Lanes are yellow for slight artefacts, orange, "
        "red for severe ones. Points under the feet are green while they rest on the floor, grey in the air.",
        "",
        *_table(scene.tracks[0], LISTED_FIRST),
    ]
    return "\n".join(lines)


def worst_artefacts(track: Track) -> str:
    """The worst artefacts of a clip, the worst first."""
    return "\n".join(_table(track, LISTED))


def _table(track: Track, top: int) -> list[str]:
    if not track.artefacts:
        return [f"**{track.name}: no artefacts**"]
    count = len(track.artefacts)
    shown = f"the worst {top} of {count} artefacts" if count > top else "all artefacts, the worst first"
    lines = [
        f"**{track.name}: {shown}**",
        "",
        "| at [s] | frames | what | where | value | severity |",
        "|---:|---|---|---|---:|---:|",
    ]
    for a in track.artefacts[:top]:
        lines.append(
            f"| {a.begin:.2f} | {a.start}-{a.stop - 1} | {a.kind.replace('_', ' ')} | {a.where} "
            f"| {number(a.value)} {a.unit} | {a.score:.2f} |"
        )
    return lines


def _raised(track: Track) -> str:
    """How far the clip was moved to stand on the floor, nothing where it was not."""
    millimetres = round(1e3 * track.raised)
    if not millimetres:
        return ""
    return f", {'raised' if millimetres > 0 else 'lowered'} by {abs(millimetres)} mm to stand on the floor"


def _what(scene: Scene) -> str:
    """What the recording opens with."""
    worst = scene.worst()
    if worst is None:
        return "the time that was asked for"
    what = f"{worst.kind.replace('_', ' ')}, {worst.where}, {number(worst.value)} {worst.unit}"
    return f"around {scene.focus:g} s, with a {what}" if scene.focus is not None else f"the worst artefact ({what})"


def certificate(measured: Certificate) -> str:
    """Every promise with the input's figure, the refined clip's, the bar, and whether it holds."""
    broken = len(measured.broken)
    verdict = "every promise holds" if measured.held else f"{broken} of {len(measured.promises)} promises are broken"
    lines = [
        f"**Certificate: {verdict}**",
        "",
        "| promise | raw | refined | at most | unit | |",
        "|---|---:|---:|---:|---|---|",
    ]
    for promise in measured.promises:
        before = "" if promise.before is None else number(promise.before)
        held = "held" if promise.held else "**BROKEN**"
        lines.append(
            f"| {promise.sentence} | {before} | {number(promise.value)} | {number(promise.bar)} | {promise.unit} "
            f"| {held} |"
        )
    return "\n".join(lines)
