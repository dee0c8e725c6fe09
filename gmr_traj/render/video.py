"""Video of clips beside each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gmr_traj import colours
from gmr_traj.exceptions import GmrTrajError
from gmr_traj.render.look import Look, heading
from gmr_traj.render.painter import Painter
from gmr_traj.render.sheet import Row, side_by_side
from gmr_traj.track import Track

FOLLOW = 0.35  # how smoothly the camera follows the base: standard deviation of a Gaussian [s]
QUALITY = 7.0  # of the H.264 encoder, 0 to 10


def check_encoder() -> None:
    """Refuse to make a video where there is no encoder.

    Raises:
        GmrTrajError: with what to install.
    """
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError as error:
        raise GmrTrajError("video needs an encoder: pip install 'gmr-traj[video]'") from error


def write(
    tracks: Sequence[Track],
    path: Path,
    span: tuple[float, float],
    look: Look,
    *,
    rate: float,
    speed: float = 1.0,
    progress: Callable[[str, int, int], None] | None = None,
) -> int:
    """Write an H.264 video (.mp4) of the clips beside each other.

    Args:
        tracks: the clips.
        path: file to write, not checked and not atomic.
        span: begin and end [s].
        look: size and camera.
        rate: pictures per second of the video [Hz].
        speed: of the motion; 0.25 is slow motion.
        progress: called with what is being done, pictures done and pictures in all.

    Returns:
        How many pictures it has.

    Raises:
        DrawingError: there is no driver to draw with.
        GmrTrajError: there is no encoder. to draw with.
    """
    check_encoder()
    import imageio_ffmpeg

    times = np.arange(span[0], span[1] - 1e-9, speed / rate)
    turned = heading(tracks[0], tracks[0].frame(span[0]))
    centres = [gaussian_filter1d(t.motion.qpos[:, :2], FOLLOW * t.motion.fps, axis=0, mode="nearest") for t in tracks]
    with ExitStack() as stack:
        painters = [stack.enter_context(Painter(track, look)) for track in tracks]
        writer = None
        for count, time in enumerate(times):
            row = []
            for place, (track, painter, centre) in enumerate(zip(tracks, painters, centres, strict=True)):
                frame = track.frame(float(time))
                picture = painter.draw(frame, centre[frame], turned)
                row.append(Row(track.name, colours.role(track.name, place), [picture]))
            page = side_by_side(row, f"{time:.2f} s" if speed == 1.0 else f"{time:.2f} s  ({speed:g} x)")
            if writer is None:
                writer = imageio_ffmpeg.write_frames(
                    str(path), page.size, fps=rate, quality=QUALITY, macro_block_size=2, ffmpeg_log_level="error"
                )
                writer.send(None)
                stack.callback(writer.close)
            writer.send(np.asarray(page).tobytes())
            if progress is not None:
                progress("drawing", count + 1, len(times))
    return len(times)
