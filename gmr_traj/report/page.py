"""The report: one page of HTML that needs nothing beside it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from gmr_traj import colours
from gmr_traj._version import __version__
from gmr_traj.metrics import Artefact, Certificate
from gmr_traj.metrics.figures import figures
from gmr_traj.metrics.signals import Signal
from gmr_traj.report import tables
from gmr_traj.report.plot import Curve, Stretch, plot
from gmr_traj.report.style import STYLE
from gmr_traj.text import number
from gmr_traj.track import Track

LISTED = 50  # artefacts in the table
AROUND = 1.0  # what the plot of one artefact shows before and after it [s]


@dataclass(frozen=True)
class Illustration:
    """A still of the clips at an artefact."""

    artefact: Artefact
    png: bytes


def page(
    title: str,
    tracks: Sequence[Track],
    certificate: Certificate | None,
    illustrations: Sequence[Illustration],
    notes: Sequence[str] = (),
) -> str:
    """The page.

    Args:
        title: heading.
        tracks: the clip, and its refinement where there is one; both over the same stances.
        certificate: of the refinement.
        illustrations: stills of the worst artefacts of the first clip, worst first.
        notes: what was decided on reading or could not be done, a sentence each.
    """
    first = tracks[0]
    parts = [f"<h1>{escape(title)}</h1>", *(f'<p class="soft">{escape(note)}</p>' for note in notes)]
    parts.append(_tiles(tracks, certificate))
    if certificate is not None:
        parts += ["<h2>Certificate</h2>", _card(tables.certificate(certificate))]
    if illustrations:
        parts.append(f"<h2>The worst artefacts of {escape(first.name)}</h2>")
        parts += [_worst(tracks, illustration) for illustration in illustrations]
    parts += ["<h2>Signals</h2>", _legend(tracks)]
    for place in range(len(first.signals)):
        own = [track.signals[place] for track in tracks]
        drawn = plot(own[0].title, _curves(tracks, own), _stretches(first, own[0]), own[0].bar)
        parts.append(_card(f"<h3>{_heading(own[0])}</h3>{drawn}"))
    columns = [(track.name, figures(track.observation, track.schedule)) for track in tracks]
    parts += ["<h2>Figures, on the floor</h2>", _card(tables.figures(columns))]
    if certificate is not None:
        parts += ["<h2>Change of the key bodies</h2>", _card(tables.change(certificate.change))]
    for track in tracks:
        count = len(track.artefacts)
        listed = f", the worst {LISTED}" if count > LISTED else ""
        parts.append(f"<h2>Artefacts of {escape(track.name)}: {count or 'none'}{listed}</h2>")
        if count:
            parts.append(_card(tables.artefacts(track.artefacts, LISTED)))
    parts.append(f'<p class="soft">gmr-traj {escape(__version__)}</p>')
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head><body><main>{''.join(parts)}</main></body></html>\n"
    )


def _tiles(tracks: Sequence[Track], certificate: Certificate | None) -> str:
    """The few figures one looks for first."""
    motion = tracks[0].motion
    tiles = [
        f"<div><b>{motion.duration:.1f} s</b>{motion.frames} frames at {motion.fps:g} Hz</div>",
        f"<div><b>{escape(tracks[0].robot.name)}</b>{tracks[0].robot.dof} joints</div>",
    ]
    for track in tracks:
        moved = f", moved {1e3 * track.raised:+.0f} mm to the floor" if abs(track.raised) > 5e-4 else ""
        tiles.append(f"<div><b>{len(track.artefacts)} artefacts</b>{escape(track.name)}{moved}</div>")
    if certificate is not None:
        broken = len(certificate.broken)
        kind, verdict = ("broken", f"{broken} broken") if broken else ("held", "all held")
        tiles.append(f'<div class="{kind}"><b>{verdict}</b>{len(certificate.promises)} promises</div>')
    return f'<div class="tiles">{"".join(tiles)}</div>'


def _worst(tracks: Sequence[Track], illustration: Illustration) -> str:
    """One artefact: a still, and the signal it shows in around it."""
    found, first = illustration.artefact, tracks[0]
    text = f"{found.kind.replace('_', ' ')}: {found.where}, {number(found.value)} {found.unit}"
    picture = base64.b64encode(illustration.png).decode("ascii")
    place = next((k for k, signal in enumerate(first.signals) if found.kind in signal.artefacts), 0)
    own = [track.signals[place] for track in tracks]
    last = (first.motion.frames - 1) / first.motion.fps
    span = (max(0.0, found.begin - AROUND), min(last, found.end + AROUND))
    drawn = plot(text, _curves(tracks, own), [_stretch(found)], own[0].bar, span, (460, 220))
    return _card(
        f'<div class="worst"><img src="data:image/png;base64,{picture}" alt="{escape(text)}"><div>'
        f"<h3>{escape(text)}<br><span>{found.begin:.2f} to {found.end:.2f} s, severity {found.score:.2f}</span></h3>"
        f"<h3><span>{_heading(own[0])}</span></h3>{drawn}</div></div>"
    )


def _curves(tracks: Sequence[Track], own: Sequence[Signal]) -> list[Curve]:
    return [
        Curve(track.name, colours.role(track.name, place), track.time, signal.values)
        for place, (track, signal) in enumerate(zip(tracks, own, strict=True))
    ]


def _stretches(track: Track, signal: Signal) -> list[Stretch]:
    """The artefacts that show in a signal; those that overlap are one stretch, named by the worst and their number."""
    found: list[tuple[Stretch, int]] = []
    worst_first = [a for a in track.artefacts if a.kind in signal.artefacts]
    for artefact in sorted(worst_first, key=lambda a: a.begin):  # stable: of those that begin together the worst first
        own = _stretch(artefact)
        if found and own.begin < found[-1][0].end:
            before, count = found.pop()
            own = Stretch(before.begin, max(before.end, own.end), before.text)
            found.append((own, count + 1))
        else:
            found.append((own, 1))
    return [Stretch(s.begin, s.end, s.text + (f", and {n - 1} more" if n > 1 else "")) for s, n in found]


def _stretch(artefact: Artefact) -> Stretch:
    what = f"{artefact.kind.replace('_', ' ')}: {artefact.where}, {number(artefact.value)} {artefact.unit}"
    return Stretch(artefact.begin, artefact.end, f"{what}, {artefact.begin:.2f} to {artefact.end:.2f} s")


def _legend(tracks: Sequence[Track]) -> str:
    marks = [
        f'<span><i style="background:{colours.hexadecimal(colours.role(track.name, place))}"></i>'
        f"{escape(track.name)}</span>"
        for place, track in enumerate(tracks)
    ]
    shaded = f'<span><i class="block"></i>artefact of {escape(tracks[0].name)} that shows in the plot</span>'
    return f'<div class="legend">{"".join(marks)}{shaded}</div>'


def _heading(signal: Signal) -> str:
    return f"{escape(signal.title)} <span>[{escape(signal.unit)}]</span>"


def _card(content: str) -> str:
    return f'<section class="card">{content}</section>'
