"""What a clip measures, what is wrong with it, and what refining it has changed.

These modules share no code with the terms of the problem, so that the proof is independent of what it proves:
kinematics by MuJoCo, distances and differences in NumPy.
"""

from gmr_traj.metrics.artefact import Artefact
from gmr_traj.metrics.artefacts import artefacts, clip_score
from gmr_traj.metrics.certificate import Certificate, certify
from gmr_traj.metrics.change import BodyChange, Change
from gmr_traj.metrics.figures import Figures, measure
from gmr_traj.metrics.promise import Promise

__all__ = [
    "Artefact",
    "BodyChange",
    "Certificate",
    "Change",
    "Figures",
    "Promise",
    "artefacts",
    "certify",
    "clip_score",
    "measure",
]
