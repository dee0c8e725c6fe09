"""Joint angles stay near those of the input: ``r = j_t - j_t(target)``, weighted with the frame's trust."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from gmr_traj.residuals import LinearResidual, Residual
from gmr_traj.terms.context import Context
from gmr_traj.terms.term import Term
from gmr_traj.variables import Variables


@dataclass(frozen=True)
class Posture(Term):
    """Fields: ``joints``, the scale of the deviation [rad]."""

    joints: float

    uses: ClassVar[tuple[str, ...]] = ("cost",)

    def residuals(self, context: Context, variables: Variables) -> list[Residual]:
        """One row a joint and frame."""
        columns = variables.steps[:, 6:]
        m = columns.size
        offset = context.centre.qpos[:, 7:] - context.target.qpos[:, 7:]
        return [
            LinearResidual(
                name="posture",
                unit="rad",
                matrix=sp.csr_matrix((np.ones(m), columns.ravel(), np.arange(m + 1)), shape=(m, variables.size)),
                offset=offset.ravel(),
                lower=np.zeros(m),
                upper=np.zeros(m),
                weights=np.repeat(context.trust * context.dt / self.joints**2, columns.shape[1]),
                frames=np.repeat(np.arange(context.frames), columns.shape[1]),
                subjects=np.tile(np.arange(columns.shape[1]), context.frames),
                rows=context.robot.joint_names,
            )
        ]
