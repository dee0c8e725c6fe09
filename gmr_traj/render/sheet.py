"""Pictures put together in rows, with names and times."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from gmr_traj.colours import RGB

INK, PAPER = (60, 64, 70), (255, 255, 255)
LETTERS = 0.045  # height of letters, relative to a picture's


@dataclass(frozen=True)
class Row:
    """One row of pictures of the same size.

    Attributes:
        name: of the clip.
        colour: of its mark.
        pictures: from left to right.  # each (H, W, 3) uint8
    """

    name: str
    colour: RGB
    pictures: Sequence[np.ndarray]


def sheet(rows: Sequence[Row], captions: Sequence[str]) -> Image.Image:
    """Rows of pictures, one below the other; each row with a name, each column with a caption below.

    Args:
        rows: as many pictures in each as captions.
        captions: of the columns.
    """
    height, width = rows[0].pictures[0].shape[:2]
    letters = max(13, round(LETTERS * height))
    font, gap = ImageFont.load_default(letters), max(2, height // 90)
    foot = round(1.9 * letters)
    size = (len(captions) * (width + gap) - gap, len(rows) * (height + gap) - gap + foot)
    page = Image.new("RGB", size, PAPER)
    pen = ImageDraw.Draw(page)
    for r, row in enumerate(rows):
        for c, picture in enumerate(row.pictures):
            page.paste(Image.fromarray(np.ascontiguousarray(picture)), (c * (width + gap), r * (height + gap)))
        _tag(pen, row, (letters // 2, r * (height + gap) + height - letters // 2), font, letters)
    for c, caption in enumerate(captions):
        middle = c * (width + gap) + width // 2
        pen.text((middle, size[1] - foot // 2), caption, fill=INK, font=font, anchor="mm")
    return page


def side_by_side(rows: Sequence[Row], caption: str) -> Image.Image:
    """The first picture of each row beside each other, each with its name, the caption below all of them."""
    height, width = rows[0].pictures[0].shape[:2]
    letters = max(13, round(LETTERS * height))
    font, gap = ImageFont.load_default(letters), max(2, height // 90)
    foot = round(1.9 * letters)
    size = (len(rows) * (width + gap) - gap, height + foot)
    page = Image.new("RGB", (size[0] + size[0] % 2, size[1] + size[1] % 2), PAPER)  # even, as video wants it
    pen = ImageDraw.Draw(page)
    for r, row in enumerate(rows):
        page.paste(Image.fromarray(np.ascontiguousarray(row.pictures[0])), (r * (width + gap), 0))
        _tag(pen, row, (r * (width + gap) + letters // 2, height - letters // 2), font, letters)
    pen.text((size[0] // 2, size[1] - foot // 2), caption, fill=INK, font=font, anchor="mm")
    return page


def to_png(page: Image.Image) -> bytes:
    """The picture as PNG."""
    stream = io.BytesIO()
    page.save(stream, "PNG", optimize=True)
    return stream.getvalue()


def _tag(
    pen: ImageDraw.ImageDraw,
    row: Row,
    corner: tuple[int, int],
    font: ImageFont.ImageFont | ImageFont.FreeTypeFont,
    letters: int,
) -> None:
    """The row's name on a mark of its colour, whose lower left corner is given."""
    pad = letters // 3
    length = pen.textlength(row.name, font=font)
    left, bottom = corner
    top = bottom - letters - 2 * pad
    pen.rounded_rectangle((left, top, left + length + 2 * pad, bottom), radius=pad, fill=row.colour)
    pen.text((left + pad, (top + bottom) / 2), row.name, fill=PAPER, font=font, anchor="lm")
