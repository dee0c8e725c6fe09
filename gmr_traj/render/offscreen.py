"""MuJoCo's renderer on a drawing surface that is no screen, whatever MUJOCO_GL was when MuJoCo was imported."""

from __future__ import annotations

import os
import sys
from types import TracebackType
from typing import Any

import mujoco
import numpy as np

from gmr_traj.exceptions import DrawingError


class Offscreen:
    """Draws a model; to be used in a ``with`` block.

    Args:
        model: what is drawn.
        width, height: of a picture [pixels], at most the model's offscreen size.

    Raises:
        DrawingError: there is no driver to draw with.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        self._context = _context(width, height)
        self._context.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=2000)
        self._option = mujoco.MjvOption()
        self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        self._model, self._size = model, (height, width)

    def draw(self, data: mujoco.MjData, camera: mujoco.MjvCamera) -> np.ndarray:
        """A picture.  # (height, width, 3) uint8"""
        self._context.make_current()
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, data, self._option, None, camera, every, self._scene)
        height, width = self._size
        window = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(window, self._scene, self._renderer)
        picture = np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(picture, None, window, self._renderer)
        return picture[::-1]

    def __enter__(self) -> Offscreen:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._context.make_current()
        self._renderer.free()
        self._context.free()


def _context(width: int, height: int) -> Any:
    """A drawing surface.

    Raises:
        DrawingError: there is none.
    """
    try:
        return surface()(width, height)
    # PyOpenGL and MuJoCo raise whatever comes to hand where a driver is missing, AttributeError of None included.
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise DrawingError(
            f"MuJoCo cannot draw here ({type(error).__name__}: {reason}); it needs EGL "
            "(Debian: apt-get install --no-install-recommends libegl1 libgl1)"
        ) from error


def surface() -> Any:
    """The class of drawing surfaces: EGL on Linux (OSMesa where MUJOCO_GL says so), the system's own elsewhere."""
    if sys.platform != "linux":
        from mujoco import GLContext
    elif os.environ.get("MUJOCO_GL", "").lower() == "osmesa":
        from mujoco.osmesa import GLContext
    else:
        from mujoco.egl import GLContext
    return GLContext
