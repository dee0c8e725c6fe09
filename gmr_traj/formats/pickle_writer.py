"""Pickles for the training code of others: readable by NumPy 1 and 2, and the same bytes for the same content."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any, BinaryIO

from gmr_traj.exceptions import ClipError

# GMR and joblib write protocol 4, and Python 3.7 and older simulators' environments read it.
_PROTOCOL = 4


class _Pickler(pickle._Pickler):
    save: Callable[[Any], None]
    write: Callable[[bytes], Any]

    def save_global(self, obj: Any, name: str | None = None) -> None:
        """NumPy 2 would write ``numpy._core``, which NumPy 1 before 1.26 cannot import; both know ``numpy.core``."""
        module = getattr(obj, "__module__", None)
        if isinstance(module, str) and module.startswith("numpy._core."):
            self.save(module.replace("numpy._core.", "numpy.core."))
            self.save(name or obj.__qualname__)
            self.write(pickle.STACK_GLOBAL)
        else:
            super().save_global(obj, name)  # type: ignore[misc]


def dump(content: Any, stream: BinaryIO) -> None:
    """Write plain containers, numbers, text and arrays.

    Without a memo, so that the bytes depend on the values and not on which of them happen to be one object.

    Raises:
        ClipError: the content contains itself.
    """
    pickler = _Pickler(stream, protocol=_PROTOCOL)
    pickler.fast = True
    try:
        pickler.dump(content)
    except RecursionError as error:
        raise ClipError("the clip's further fields contain themselves and cannot be written") from error
