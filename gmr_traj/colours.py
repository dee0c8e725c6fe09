"""The colours of pictures, plots and recordings: one for each role, the same everywhere, on light and dark ground."""

from __future__ import annotations

RGB = tuple[int, int, int]

#: Roles in the order in which further clips get their colours.
ROLES: dict[str, RGB] = {
    "raw": (230, 108, 55),
    "refined": (38, 148, 214),
    "rollout": (168, 112, 214),
    "third": (92, 176, 92),
    "fourth": (200, 160, 50),
    "fifth": (205, 100, 150),
}
HUMAN: RGB = (196, 190, 180)
TARGET: RGB = (242, 193, 78)
LIMIT: RGB = (140, 140, 140)
FORCE: RGB = (150, 240, 130)
FAULT: RGB = (214, 48, 60)
#: What rests on the floor, by part of the sole, or a limb.
PARTS: dict[str, RGB] = {"heel": (110, 190, 120), "toe": (66, 140, 96), "limb": (150, 150, 60)}


def role(name: str, place: int) -> RGB:
    """Colour of the clip that is called ``name`` and stands in place ``place`` among those shown."""
    return ROLES.get(name) or list(ROLES.values())[place % len(ROLES)]


def hexadecimal(colour: RGB) -> str:
    """``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
