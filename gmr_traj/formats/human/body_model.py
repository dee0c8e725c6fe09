"""Body models of the SMPL family, read from the user's own file: which skeleton a shape has.

Nothing of a model ships with gmr-traj.  npz files are read as they are.  Pickles (SMPL's own, of Python 2) are read
by the restricted unpickler, with SciPy's sparse matrices and chumpy's arrays as records of their fields: neither
package's classes are loaded, and chumpy need not be installed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import npz_file, safe_pickle
from gmr_traj.formats.file_bytes import read_bytes
from gmr_traj.formats.human import smpl_joints

_KEYS = ("J_regressor", "v_template", "shapedirs", "kintree_table")
_RECORDS = frozenset(
    {("scipy.sparse.csc", "csc_matrix"), ("scipy.sparse._csc", "csc_matrix"), ("chumpy.ch", "Ch")}
    | {("scipy.sparse.csr", "csr_matrix"), ("scipy.sparse._csr", "csr_matrix")}
)
_LARGEST = 100.0  # [m] nothing of a body is this far from its origin


@dataclass(frozen=True)
class BodyModel:
    """What of a body model the skeleton depends on.

    Attributes:
        model: ``smpl``, ``smplh`` or ``smplx``, by the number of joints.
        template: vertices of the mean body [m].  # (V, 3)
        directions: change of the vertices with each shape parameter [m].  # (V, 3, S)
        regressor: joints from vertices.  # (J, V)
    """

    model: str
    template: np.ndarray
    directions: np.ndarray
    regressor: Any

    def joints(self, betas: np.ndarray) -> np.ndarray:
        """Joints of a shape in the T-pose, ``J (v + S betas)``, each in its parent's frame [m].  # (J, 3)"""
        joints = np.asarray(self.regressor @ self._vertices(betas))
        parents = np.array(smpl_joints.parents(self.model))
        return np.where(parents[:, None] < 0, joints, joints - joints[np.maximum(parents, 0)])

    def height(self, betas: np.ndarray) -> float:
        """From the lowest to the highest vertex of a shape in the T-pose [m]."""
        return float(np.ptp(self._vertices(betas)[:, 1]))

    def _vertices(self, betas: np.ndarray) -> np.ndarray:
        used = min(len(betas), self.directions.shape[2])
        vertices: np.ndarray = self.template + self.directions[..., :used] @ betas[:used]
        return vertices


def load_body_model(path: str | Path) -> BodyModel:
    """Read a model's npz or pkl file.

    Raises:
        ClipError: it cannot be read, or is no model of SMPL, SMPL-H or SMPL-X; names the file.
    """
    path = Path(path)
    try:
        data = read_bytes(path)
        if data.startswith(b"PK\x03\x04"):
            return _model(npz_file.load(data, only=_KEYS))
        content, _ = safe_pickle.load(data, _RECORDS)
        return _model(content if isinstance(content, dict) else {})
    except GmrTrajError as error:
        raise ClipError(f"body model {path}: {error}") from error


def _model(content: Mapping[str, Any]) -> BodyModel:
    missing = [key for key in _KEYS if key not in content]
    if missing:
        raise ClipError(f"has no {missing[0]}; expected a SMPL, SMPL-H or SMPL-X model with {', '.join(_KEYS)}")
    template = _array(content["v_template"], "v_template", 2)
    directions = _array(content["shapedirs"], "shapedirs", 3)
    tree = _array(content["kintree_table"], "kintree_table", 2)
    regressor = _regressor(content["J_regressor"])
    vertices, joints = len(template), tree.shape[1]
    model = next((name for name, names in smpl_joints.JOINTS.items() if len(names) == joints), None)
    if model is None or not np.array_equal(tree[0, 1:], smpl_joints.parents(model)[1:]):
        raise ClipError(
            f"kintree_table is of {joints} joints, and not the tree of SMPL (24), SMPL-H (52) or SMPL-X (55)"
        )
    shapes = {"v_template": template.shape[1:], "shapedirs": directions.shape[:2], "J_regressor": regressor.shape}
    for name, expected in (
        ("v_template", (3,)),
        ("shapedirs", (vertices, 3)),
        ("J_regressor", (joints, vertices)),
    ):
        if shapes[name] != expected:
            raise ClipError(f"{name} is of shape {shapes[name]}; expected {expected}")
    # SMPL-X files carry expressions behind the shape: 300 and 100, or 10 and 10.
    shape = {400: 300, 20: 10}.get(directions.shape[2], directions.shape[2]) if model == "smplx" else None
    return BodyModel(model, template, directions[..., :shape], regressor)


def _array(value: Any, name: str, axes: int) -> np.ndarray:
    """A field as an array of numbers, taken out of a chumpy record where it is in one."""
    if isinstance(value, safe_pickle.Record):
        value = value.state.get("x") if isinstance(value.state, dict) else None
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu" or value.ndim != axes or not value.size:
        raise ClipError(f"{name} is not an array of numbers with {axes} axes; save the model as npz with plain arrays")
    array = value.astype(np.float64)
    if name != "kintree_table" and not (np.abs(array) < _LARGEST).all():
        raise ClipError(f"{name} has values that are not finite or above {_LARGEST:g}")
    return array


def _regressor(value: Any) -> Any:
    """Joints from vertices, dense, or sparse as SciPy pickles it."""
    if not isinstance(value, safe_pickle.Record):
        return _array(value, "J_regressor", 2)
    state = value.state if isinstance(value.state, dict) else {}
    parts = [state.get(key) for key in ("data", "indices", "indptr")]
    shape = state.get("_shape", state.get("shape"))
    plain = all(isinstance(part, np.ndarray) and part.ndim == 1 and part.dtype.kind in "fiu" for part in parts)
    if not plain or not isinstance(shape, tuple) or len(shape) != 2 or not all(isinstance(k, int) for k in shape):
        raise ClipError("J_regressor is no sparse matrix that is known; save the model as npz with plain arrays")
    # The columns' or rows' pointers tell which of the two orders it is: one more than there are of them.
    kind = sparse.csr_matrix if len(parts[2]) == shape[0] + 1 else sparse.csc_matrix  # type: ignore[arg-type]
    try:
        matrix = kind(tuple(parts), shape=shape)
        matrix.check_format(full_check=True)
    except (ValueError, TypeError, IndexError) as error:
        raise ClipError(f"J_regressor is a damaged sparse matrix: {error}") from error
    if not (np.abs(matrix.data) < _LARGEST).all():
        raise ClipError("J_regressor has values that are not finite")
    return matrix
