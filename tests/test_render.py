"""Stills, strips and video without a screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawing import near, need_mujoco_drawing

from gmr_traj.exceptions import DrawingError, GmrTrajError
from gmr_traj.formats import read_clip
from gmr_traj.render import Look, Painter, offscreen, video
from gmr_traj.render.look import heading
from gmr_traj.render.painter import overlapping
from gmr_traj.render.stage import OVERLAP
from gmr_traj.render.stills import still, strip
from gmr_traj.track import Track, track

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"
SMALL = Look(96, 112, meshes=False)
RED = tuple(round(255 * value) for value in OVERLAP[:3])


@pytest.fixture(scope="module")
def raw(g1) -> Track:
    return track("raw", read_clip(EXAMPLE, g1).motion, g1)


def test_what_overlaps_is_red(raw):
    need_mujoco_drawing()
    deep, free = 6, 50
    assert overlapping(raw, deep) and not overlapping(raw, free)
    with Painter(raw, SMALL) as painter:
        pictures = {frame: painter.draw(frame, raw.motion.qpos[frame, :2], 0.0) for frame in (deep, free)}
        again = painter.draw(deep, raw.motion.qpos[deep, :2], 0.0)
    assert near(pictures[deep], RED) > 20 and near(pictures[free], RED) == 0
    np.testing.assert_array_equal(pictures[deep], again)


def test_overlap_is_that_of_the_certificate(raw):
    for frame in range(raw.motion.frames):
        assert bool(overlapping(raw, frame)) == (raw.observation.overlaps.by_frame()[frame] > 1e-3)


def test_the_camera_keeps_the_robot_in_the_middle(raw):
    need_mujoco_drawing()
    with Painter(raw, SMALL) as painter:
        here = painter.draw(50, raw.motion.qpos[50, :2], 0.0).astype(int)
        elsewhere = painter.draw(50, raw.motion.qpos[50, :2] + [40.0, 0.0], 0.0).astype(int)
    robot = np.abs(here - elsewhere).sum(axis=2) > 60
    rows, columns = np.nonzero(robot)
    assert 0.1 < robot.mean() < 0.6
    assert abs(columns.mean() / 96 - 0.5) < 0.12 and abs(rows.mean() / 112 - 0.55) < 0.15


def test_the_heading_is_the_base_s(raw, g1):
    qpos = np.repeat(g1.nominal[None], 4, axis=0)
    qpos[:, 3:7] = [np.cos(0.4), 0.0, 0.0, np.sin(0.4)]
    turned = track("turned", raw.motion.with_qpos(qpos), g1)
    assert heading(turned, 0) == pytest.approx(0.8)


def test_sheets_have_a_picture_for_every_clip_and_time(raw):
    need_mujoco_drawing()
    one = still([raw, raw], 0.2, SMALL)
    assert one.width >= 2 * 96 and one.height > 112 and one.width % 2 == one.height % 2 == 0
    several = strip([raw, raw], [0.0, 0.5, 1.0], SMALL)
    assert several.width >= 3 * 96 and several.height > 2 * 112


def test_video_has_every_picture(raw, tmp_path):
    need_mujoco_drawing()
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="no encoder: the extra 'video' is not installed")
    count = video.write([raw, raw], tmp_path / "v.mp4", (0.0, 0.5), SMALL, rate=20.0, speed=0.5)
    assert count == 20
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "v.mp4"))
    assert frames == 20 and seconds == pytest.approx(1.0, abs=0.06)


def test_without_an_encoder_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(GmrTrajError, match=r"pip install 'gmr-traj\[video\]'"):
        video.check_encoder()


def test_without_a_driver_it_says_what_to_install(raw, monkeypatch):
    def broken(width, height):
        raise AttributeError("'NoneType' object has no attribute 'eglQueryString'")

    monkeypatch.setattr(offscreen, "surface", lambda: broken)
    with pytest.raises(DrawingError, match="libegl1"), Painter(raw, SMALL):
        pass


@pytest.mark.parametrize(("wrong", "text"), [({"width": 5}, "pixels in width"), ({"distance": 0.0}, "positive")])
def test_looks_that_cannot_be(wrong, text):
    with pytest.raises(GmrTrajError, match=text):
        Look(**wrong)
