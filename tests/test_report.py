"""The report: one page of HTML."""

from __future__ import annotations

import base64
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from drawing import need_chromium, need_mujoco_drawing, pixels
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from gmr_traj.cli.main import main
from gmr_traj.formats import read_clip
from gmr_traj.metrics import certify
from gmr_traj.render import to_png
from gmr_traj.report import Illustration, page
from gmr_traj.report.page import _stretches
from gmr_traj.report.plot import Curve, Stretch, _thinned, plot, ticks
from gmr_traj.track import track

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"
VOID = {"meta", "link", "img", "br"}


@pytest.fixture(scope="module")
def tracks(g1):
    raw = track("raw <&>", read_clip(EXAMPLE, g1).motion, g1)
    smooth = raw.motion.with_qpos(np.repeat(g1.nominal[None], raw.motion.frames, axis=0))
    return raw, track("refined", smooth, g1, raw.schedule)


@pytest.fixture(scope="module")
def html(tracks, g1) -> str:
    raw, refined = tracks
    measured = certify(raw.motion, refined.motion, g1, raw.schedule, levelling=0.0)
    pictures = [Illustration(a, to_png(Image.new("RGB", (30, 20), (200, 10, 10)))) for a in raw.artefacts[:2]]
    return page("a & b", tracks, measured, pictures, ["decided: <so>"])


class Checker(HTMLParser):
    """Collects images and links, and checks that what is opened is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open, self.sources, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def test_the_page_is_whole_and_needs_nothing_beside_it(html, tracks):
    checker = Checker()
    checker.feed(html)
    assert checker.open == []
    assert len(checker.sources) == 3 and all(source.startswith("data:") for source in checker.sources)
    assert "url(" not in html and "@import" not in html and "<script" not in html
    for source in checker.sources[1:]:
        assert pixels(base64.b64decode(source.split(",")[1])).shape == (20, 30, 3)
    text = " ".join(checker.text)
    assert "raw <&>" in text and "decided: <so>" in text and "a & b" in text
    for signal in tracks[0].signals:
        assert signal.title in text
    assert "BROKEN" in text  # a robot that stands still is not the punch


def test_every_artefact_is_shaded_once(tracks):
    raw = tracks[0]
    for signal in raw.signals:
        expected = np.zeros(raw.motion.frames, bool)
        for a in raw.artefacts:
            if a.kind in signal.artefacts:
                expected[a.start : a.stop] = True
        shaded = np.zeros(raw.motion.frames, int)
        for s in _stretches(raw, signal):
            shaded[round(s.begin * raw.motion.fps) : round(s.end * raw.motion.fps)] += 1
        np.testing.assert_array_equal(shaded, expected.astype(int))


def test_one_clip_and_one_frame_make_a_page(g1, tracks):
    single = track("one", tracks[0].motion.with_qpos(tracks[0].motion.qpos[:1]), g1)
    checker = Checker()
    checker.feed(page("one", [single], None, []))
    assert checker.open == []


def points(svg: str) -> np.ndarray:
    """The points of all curves of a plot, in pixels.  # (N, 2)"""
    found = [np.array(re.findall(r"[-\d.]+", d), float) for d in re.findall(r'class="curve" d="([^"h]*)', svg)]
    return np.concatenate(found).reshape(-1, 2)


def test_a_plot_is_to_scale():
    seconds = np.linspace(0.0, 2.0, 21)
    found = points(plot("t", [Curve("a", (0, 0, 0), seconds, 3.0 * seconds - 1.0)]))
    slope = np.polyfit(found[:, 0], found[:, 1], 1)
    np.testing.assert_allclose(found[:, 1], np.polyval(slope, found[:, 0]), atol=0.2)
    assert slope[0] < 0.0  # up is up
    assert found[:, 0].min() >= 0.0 and found[:, 0].max() <= 900.0


def test_gaps_break_the_curve_and_stretches_are_where_they_are():
    seconds = np.arange(9.0)
    values = np.array([0.0, 1.0, np.nan, 2.0, np.nan, np.nan, 1.0, 0.0, 1.0])
    svg = plot("t", [Curve("a", (0, 0, 0), seconds, values)], [Stretch(2.0, 4.0, "<b>")], bar=5.0)
    (path,) = re.findall(r'class="curve" d="([^"]*)"', svg)
    assert path.count("M") == 3 and path.count("h0") == 1
    x, width = (float(v) for v in re.search(r'rect class="fault" x="([\d.]+)" y="\d+" width="([\d.]+)"', svg).groups())
    assert x == pytest.approx(58 + 2 / 8 * 828, abs=0.1) and width == pytest.approx(2 / 8 * 828, abs=0.1)
    assert "&lt;b&gt;" in svg
    assert plot("t", [Curve("a", (0, 0, 0), seconds, np.full(9, np.nan))])  # nothing to draw


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 12))
def test_ticks_are_round_and_few(low, length, most):
    high = low + length
    if high <= low:
        return
    found = ticks(low, high, most)
    assert len(found) <= most + 1
    step = length / most
    assert all(low - 1e-6 * step - 1e-9 * abs(low) <= tick <= high + 1e-6 * step + 1e-9 * abs(high) for tick in found)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=400))
def test_thinning_keeps_what_can_be_seen(values):
    y = np.array(values)
    x = np.linspace(0.0, 20.0, len(y))
    px, py = _thinned(x, y)
    assert (np.diff(px) >= 0).all() and len(px) <= 4 * 21 + 4
    assert (px[0], px[-1], py.min(), py.max()) == (x[0], x[-1], y.min(), y.max())
    for column in np.unique(np.floor(x)):
        own, kept = y[np.floor(x) == column], py[np.floor(px) == column]
        assert (kept.min(), kept.max()) == (own.min(), own.max())


def browse(program: str, html: str, folder: Path) -> tuple[str, list[str]]:
    """What the browser makes of a page, as text, and what it logs on its console."""
    path = folder / "shown.html"
    path.write_text(html)
    flags = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    flags += " --disable-component-update --disable-sync --enable-logging=stderr --dump-dom"
    done = subprocess.run(
        [program, *flags.split(), f"--user-data-dir={folder / 'profile'}", path.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


PROBE = """<script>
const broken = [...document.images].filter(i => !(i.complete && i.naturalWidth > 0)).length;
const outside = performance.getEntriesByType("resource").filter(e => !e.name.startsWith("data:")).length;
document.title = `${document.images.length} images, ${broken} broken, ${outside} from elsewhere`;
</script>"""


@pytest.mark.slow
def test_a_browser_shows_the_command_s_report_without_complaint(tmp_path, monkeypatch):
    program = need_chromium()
    need_mujoco_drawing()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    assert main(["refine", "punch.npz", "--quiet"]) == 0
    assert main(["report", "punch.npz", "punch_refined.npz", "-o", "report.html", "--quiet"]) == 0
    html = (tmp_path / "report.html").read_text()
    assert html.count("data:image/png") == 3 and "all held" in html
    text, console = browse(program, html.replace("</body>", PROBE + "</body>"), tmp_path)
    assert "<title>3 images, 0 broken, 0 from elsewhere</title>" in text
    assert console == []
    # The same look at a page with faults sees them.
    faulty = html.replace("data:image/png;base64,", "data:image/png;base64,AAAA", 1)
    text, console = browse(program, faulty.replace("</body>", PROBE + "<script>unknown()</script></body>"), tmp_path)
    assert "<title>3 images, 1 broken" in text and any("unknown" in line for line in console)
