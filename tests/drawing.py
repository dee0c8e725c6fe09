"""What drawing tests need of the machine, and why they are left out where it is not there."""

from __future__ import annotations

import io
import shutil

import mujoco
import numpy as np
import pytest
from PIL import Image

from gmr_traj.exceptions import DrawingError
from gmr_traj.render.offscreen import Offscreen


def need_mujoco_drawing() -> None:
    """Skip where MuJoCo has no driver to draw with."""
    try:
        with Offscreen(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16):
            pass
    except DrawingError as error:
        pytest.skip(f"nothing to draw with: {error}")


def need_chromium() -> str:
    """The browser's program; skips where it is not installed."""
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("no browser: chromium is not installed (Debian: apt-get install --no-install-recommends chromium)")
    return program


def pixels(png: bytes) -> np.ndarray:
    """A PNG's pixels.  # (H, W, 3) uint8"""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def near(picture: np.ndarray, colour: tuple[int, int, int], within: float = 60.0) -> int:
    """How many pixels have about the hue of a colour: their direction from grey is its, whatever the light."""
    wanted = np.array(colour, float) - np.mean(colour)
    own = picture.reshape(-1, 3).astype(float)
    own -= own.mean(axis=1, keepdims=True)
    length = np.linalg.norm(own, axis=1)
    cosine = own @ wanted / np.maximum(length * np.linalg.norm(wanted), 1e-9)
    return int(((cosine > 0.97) & (length > within)).sum())
