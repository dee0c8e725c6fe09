"""The recording of the example in the viewer itself, without a screen: what a newcomer sees."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from drawing import near, pixels

from gmr_traj import colours
from gmr_traj.cli.main import main
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.motion import RobotMotion
from gmr_traj.track import track
from gmr_traj.viewer import Scene, save

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))
from screenshot import look, software_renderer

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"
SIZE = (1600, 1000)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        software_renderer() is None and "VK_ICD_FILENAMES" not in os.environ and not Path("/dev/dri").exists(),
        reason="the rerun viewer has no driver to draw with (Debian: apt-get install --no-install-recommends "
        "mesa-vulkan-drivers libvulkan1)",
    ),
]


def blank(png: bytes) -> bool:
    """Whether a picture is nothing but background: hardly any pixel is of another colour than the commonest."""
    found, count = np.unique(pixels(png).reshape(-1, 3), axis=0, return_counts=True)
    return len(found) < 50 or count.max() > 0.995 * count.sum()


def test_the_example_before_and_after(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "punch.npz").write_bytes(EXAMPLE.read_bytes())
    assert main(["refine", "punch.npz", "--rerun", "punch.rrd", "--quiet"]) == 0
    opened = look(tmp_path / "punch.rrd", None, SIZE, ("3D", "TimeSeries"))
    assert opened.reports == ()
    # It opens in the loop around the worst artefact, the jump of the elbow at 0.80 s.
    assert opened.timeline == "highlight" and 0.1 < opened.seconds < 1.6
    robots = {name: png for name, png in opened.views.items() if "alone" in name or "one place" in name}
    assert set(robots) == {"raw, refined in one place", "raw alone", "refined alone"}
    assert len(opened.views) == 3 + 8
    assert not any(blank(png) for png in opened.views.values())
    orange, blue = (colours.ROLES[name] for name in ("raw", "refined"))
    of_raw, of_refined = (pixels(robots[f"{name} alone"]) for name in ("raw", "refined"))
    assert near(of_raw, orange) > 500 and near(of_raw, blue) == 0
    assert near(of_refined, blue) > 500 and near(of_refined, orange) == 0
    assert near(pixels(opened.views["Fastest joint [% of its limit]"]), orange) > 100
    moved = look(tmp_path / "punch.rrd", 0.83, SIZE)
    assert (moved.timeline, moved.reports) == ("time", ()) and moved.seconds == pytest.approx(0.83)


def test_a_second_robot(talos, tmp_path):
    steps = np.linspace(0.0, 3.0, 90)
    qpos = np.repeat(talos.nominal[None], 90, axis=0)
    arms = [7 + j for j, name in enumerate(talos.joint_names) if name.startswith("arm_") and name.endswith("_4_joint")]
    qpos[:, arms] -= 0.3 * np.sin(2.0 * steps)[:, None]
    shown = track("talos", RobotMotion(qpos, 30.0, talos.joint_names, talos.name), talos)
    save(Scene("talos", (shown,)), tmp_path / "talos.rrd")
    seen = look(tmp_path / "talos.rrd", 1.0, SIZE, ("3D",))
    assert seen.reports == () and not blank(seen.views["talos alone"])


def test_a_recording_that_is_not_there(tmp_path):
    with pytest.raises(GmrTrajError, match="no such file"):
        look(tmp_path / "absent.rrd", None, SIZE)
