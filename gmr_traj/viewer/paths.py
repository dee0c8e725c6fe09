"""Names of things as parts of entity paths, in which a slash divides and other signs would have to be escaped."""

from __future__ import annotations

import re


def part(name: str) -> str:
    """A name as one part of a path: letters, digits, `_`, `-` and `.` stay, everything else becomes `_`."""
    return re.sub(r"[^\w.-]", "_", name)
