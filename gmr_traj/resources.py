"""Data that ships with gmr-traj: robots, problems, configs and an example, found by name or by path.

A wheel carries the top-level folders ``models``, ``problems`` and ``configs`` as ``gmr_traj/share/<kind>``, and of
``examples`` one motion; in a checkout (and an editable install) they are beside the package.
"""

from __future__ import annotations

from pathlib import Path

from gmr_traj.exceptions import ResourceError

KINDS = ("models", "problems", "configs", "examples")
_PACKAGE = Path(__file__).resolve().parent


def folder(kind: str) -> Path:
    """Folder that holds the resources of one kind.

    Args:
        kind: one of ``KINDS``.

    Raises:
        ResourceError: the kind is unknown, or the installation carries no such folder.
    """
    if kind not in KINDS:
        raise ResourceError(f"there is no kind of resource {kind!r}; the kinds are {', '.join(KINDS)}")
    candidates = (_PACKAGE / "share" / kind, _PACKAGE.parent / kind)
    for candidate in candidates:
        if candidate.is_dir():
            return candidate
    places = " nor ".join(str(candidate) for candidate in candidates)
    raise ResourceError(f"this installation of gmr-traj carries no {kind}: neither {places} exists; reinstall it")


def names(kind: str) -> tuple[str, ...]:
    """Names of the resources of one kind, sorted: folders by their name, TOML files by their stem."""
    found = {p.name for p in folder(kind).iterdir() if p.is_dir() and (p / "robot.toml").is_file()}
    found |= {p.stem for p in folder(kind).iterdir() if p.is_file() and p.suffix == ".toml"}
    return tuple(sorted(found))


def find(kind: str, name: str | Path) -> Path:
    """Path of a resource.

    A path that exists wins over a name; a name is looked up in the folder of its kind, with or without ``.toml``.

    Args:
        kind: one of ``KINDS``.
        name: name of a resource, or a path to a file or folder of one's own.

    Returns:
        The file or folder.

    Raises:
        ResourceError: there is none; the message lists the names that exist.
    """
    given = Path(name).expanduser()
    if given.exists():
        return given.resolve()
    home = folder(kind)
    if given.name == str(given):  # a bare name, not a path that leads elsewhere
        for candidate in (home / given, home / f"{given}.toml"):
            if candidate.exists():
                return candidate
    known = ", ".join(names(kind)) or "none"
    raise ResourceError(f"{name}: no such file, and no {kind[:-1]} of that name; there are: {known}")
