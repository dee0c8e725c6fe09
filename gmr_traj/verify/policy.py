"""Trained trackers in ONNX files: loading, and finding out which kind one is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gmr_traj.exceptions import PolicyError
from gmr_traj.robot import Robot
from gmr_traj.verify.controller import Controller


class Network:
    """An ONNX network that maps one vector of observations to one of actions.

    Args:
        path: the file.

    Raises:
        PolicyError: onnxruntime is not installed, or the file is missing, not ONNX, or of another form.

    Attributes:
        path: the file.
        inputs, outputs: number of observations, of actions.
        metadata: what the file says of itself.
    """

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime
        except ModuleNotFoundError:
            raise PolicyError(
                "policies are run by onnxruntime, which is not installed: pip install 'gmr-traj[policy]'"
            ) from None
        if not path.is_file():
            raise PolicyError(f"{path}: there is no such policy file")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # the same sums in the same order
        options.log_severity_level = 4  # what is wrong is said below, in one line
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime raises classes of its own, one for each way a file can be broken
            raise PolicyError(f"{path}: is not an ONNX network that can be run: {_first_line(error)}") from error
        self.path = path
        given, made = self._session.get_inputs(), self._session.get_outputs()
        self._observations = given[0]
        extra = [entry.name for entry in given[1:] if entry.name != "time_step"]
        if extra:
            raise PolicyError(f"{path}: has the input {extra[0]!r}; expected observations, and at most a time_step")
        self._step = next((entry for entry in given[1:]), None)
        self._made = next((entry for entry in made if entry.name == "actions"), made[0])
        self.inputs, self.outputs = _width(path, self._observations), _width(path, self._made)
        self.metadata = dict(self._session.get_modelmeta().custom_metadata_map)

    def __call__(self, observations: np.ndarray, step: int = 0) -> np.ndarray:
        """Actions of one vector of observations.

        Raises:
            PolicyError: the network cannot be run on it.
        """
        feed: dict[str, Any] = {self._observations.name: observations.astype(np.float32)[None]}
        if self._step is not None:
            kind = np.float32 if "float" in self._step.type else np.int64
            feed[self._step.name] = np.full([1] * len(self._step.shape), step, dtype=kind)
        try:
            (actions,) = self._session.run([self._made.name], feed)
        except Exception as error:
            raise PolicyError(f"{self.path}: does not run: {_first_line(error)}") from error
        return np.asarray(actions[0], dtype=float)


def load_policy(path: Path, robot: Robot, steer: float = 0.0) -> Controller:
    """The controller that an ONNX file holds.

    Args:
        path: the file.
        robot: the robot it is to move.
        steer: gain by which the commanded velocity is turned toward where the reference is in the world, for policies
            that do not see that themselves [1/s].

    Raises:
        PolicyError: the file is of no known kind, or made for another robot.
    """
    from gmr_traj.verify.beyondmimic_policy import BeyondMimicPolicy
    from gmr_traj.verify.policy_form import WIDTHS
    from gmr_traj.verify.twist2_policy import INPUTS, Twist2Policy

    network = Network(path)
    if network.inputs == INPUTS:
        return Twist2Policy(network, robot, steer)
    if network.inputs in WIDTHS:
        return BeyondMimicPolicy(network, robot)
    known = " or ".join(str(width) for width in WIDTHS)
    raise PolicyError(
        f"{path}: takes {network.inputs} observations; expected {INPUTS} (TWIST2's tracker) or {known} (BeyondMimic's)"
    )


def roll_pitch_yaw(quaternion: np.ndarray) -> tuple[float, float, float]:
    """Euler angles ``R = Rz(yaw) Ry(pitch) Rx(roll)`` of a quaternion wxyz [rad]."""
    w, x, y, z = quaternion
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return float(roll), float(pitch), float(yaw)


def _width(path: Path, entry: Any) -> int:
    if len(entry.shape) != 2 or not isinstance(entry.shape[1], int):
        raise PolicyError(f"{path}: {entry.name!r} has shape {entry.shape}; expected [batch, values]")
    return int(entry.shape[1])


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
