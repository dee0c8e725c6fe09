"""SMPL, SMPL-H and SMPL-X motions: with a body model, without one, and whatever keys they come with."""

from __future__ import annotations

import pickle
import re
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from human_files import smpl_file, smpl_motion, smplx_file, smplx_parts_file
from scipy import sparse
from scipy.spatial.transform import Rotation

from gmr_traj.exceptions import ClipError
from gmr_traj.formats import safe_pickle
from gmr_traj.formats.human import is_human, read_human
from gmr_traj.formats.human.body_model import load_body_model
from gmr_traj.formats.human.mean_skeleton import mean_joints
from gmr_traj.formats.human.smpl_joints import JOINTS, parents
from gmr_traj.human_motion import HumanMotion

VERTICES = 40


def toy_model(model: str = "smpl", betas: int = 10) -> dict[str, Any]:
    """A body model in small: the mean skeleton's joints (the rest on the wrists) from vertices around them."""
    rng = np.random.default_rng(1)
    names, tree = JOINTS[model], np.array(parents(model))
    offsets = np.zeros((len(names), 3))
    mean = mean_joints(model, np.zeros(0))
    offsets[: len(mean)] = mean
    joints = np.zeros((len(names), 3))
    for j, parent in enumerate(tree):
        joints[j] = offsets[j] + (joints[parent] if parent >= 0 else 0)
    regressor = rng.uniform(size=(len(names), VERTICES))
    regressor /= regressor.sum(axis=1, keepdims=True)
    # Vertices for which the regressor gives these joints exactly.
    template = np.linalg.lstsq(regressor, joints, rcond=None)[0]
    if len(names) > VERTICES:
        template = rng.normal(scale=0.3, size=(VERTICES, 3))
    table = np.stack([np.where(tree < 0, 2**32 - 1, tree), np.arange(len(names))]).astype(np.uint32)
    directions = 0.01 * rng.normal(size=(VERTICES, 3, betas))
    return {"J_regressor": regressor, "v_template": template, "shapedirs": directions, "kintree_table": table}


def write(path: Path, content: dict[str, Any]) -> Path:
    np.savez(path, **content)
    return path


def by_hand(offsets: np.ndarray, motion: dict[str, np.ndarray], frame: int) -> dict[str, np.ndarray]:
    """World positions by 4x4 matrices."""
    world: list[np.ndarray] = []
    names = JOINTS["smpl"]
    for j, parent in enumerate(parents("smpl")):
        local = np.eye(4)
        local[:3, :3] = Rotation.from_rotvec(motion["poses"][frame, 3 * j : 3 * j + 3]).as_matrix()
        local[:3, 3] = offsets[j] + (motion["trans"][frame] if parent < 0 else 0)
        world.append(local if parent < 0 else world[parent] @ local)
    return {name: matrix[:3, 3] for name, matrix in zip(names, world, strict=True)}


def test_kinematics_are_those_of_plain_matrices(tmp_path: Path) -> None:
    smpl_file(tmp_path / "clip.npz")
    human = read_human(tmp_path / "clip.npz")
    motion = smpl_motion(width=72)
    for frame in (0, 17):
        expected = by_hand(mean_joints("smpl", motion["betas"]), motion, frame)
        for name, position in expected.items():
            np.testing.assert_allclose(human.positions[frame, human.index(name)], position, atol=1e-12)


def test_smplx_of_amass(tmp_path: Path) -> None:
    path = tmp_path / "clip.npz"
    smplx_file(path)
    assert is_human(path)
    human = read_human(path)
    assert (human.rig, human.fps, human.frames) == ("smplx", 120.0, 30)
    assert human.names == JOINTS["smplx"][:22]
    assert human.height == pytest.approx(1.66 + 0.1 * 1.5)
    assert human.positions[0, human.index("head"), 2] > 1.4
    assert abs(human.positions[0, human.index("left_foot"), 2]) < 0.1
    # The person looks along -y: z of the model, turned about x.
    toes = human.positions[0, human.index("left_foot")] - human.positions[0, human.index("left_ankle")]
    assert toes[1] < -0.1
    assert any("mean proportions" in note and "--body-model" in note for note in human.notes)


def equal(a: HumanMotion, b: HumanMotion) -> None:
    np.testing.assert_allclose(a.positions, b.positions, atol=1e-12)
    np.testing.assert_allclose(a.quaternions, b.quaternions, atol=1e-12)
    assert (a.names, a.rig, a.height, a.fps) == (b.names, b.rig, b.height, b.fps)


def test_the_parts_are_the_whole(tmp_path: Path) -> None:
    smplx_file(tmp_path / "whole.npz")
    smplx_parts_file(tmp_path / "parts.npz")
    equal(read_human(tmp_path / "whole.npz"), read_human(tmp_path / "parts.npz"))
    motion = smpl_motion()
    poses = motion.pop("poses")
    parts = {
        "global_orient": poses[:, :3], "body_pose": poses[:, 3:66], "pose_jaw": poses[:, 66:69],
        "pose_eye": poses[:, 69:75], "pose_hand": poses[:, 75:],
    }  # fmt: skip
    write(tmp_path / "model.npz", toy_model("smplx"))
    write(tmp_path / "all_parts.npz", motion | parts)
    equal(
        read_human(tmp_path / "whole.npz", body_model=tmp_path / "model.npz"),
        read_human(tmp_path / "all_parts.npz", body_model=tmp_path / "model.npz"),
    )


def test_smplh_has_the_same_body(tmp_path: Path) -> None:
    motion = smpl_motion()
    poses = motion["poses"]
    write(tmp_path / "h.npz", motion | {"poses": np.hstack([poses[:, :66], poses[:, 75:]])})
    smplx_file(tmp_path / "x.npz")
    equal(read_human(tmp_path / "h.npz"), read_human(tmp_path / "x.npz"))


def test_the_size_follows_the_first_beta(tmp_path: Path) -> None:
    motion = smpl_motion()
    sizes = []
    for first in (0.0, 1.66):
        path = write(tmp_path / "clip.npz", motion | {"betas": np.array([first, 5.0, -3.0])})
        human = read_human(path)
        legs = human.positions[:, human.index("left_knee")] - human.positions[:, human.index("left_hip")]
        sizes.append(np.linalg.norm(legs[0]))
    assert sizes[1] / sizes[0] == pytest.approx(1.1)


def test_y_up_is_seen(tmp_path: Path) -> None:
    motion = smpl_motion()
    smplx_file(tmp_path / "z.npz")
    turn = Rotation.from_euler("x", -90, degrees=True)
    motion["poses"][:, :3] = (turn * Rotation.from_rotvec(motion["poses"][:, :3])).as_rotvec()
    motion["trans"] = turn.apply(motion["trans"])
    a, b = read_human(tmp_path / "z.npz"), read_human(write(tmp_path / "y.npz", motion))
    np.testing.assert_allclose(a.positions, b.positions, atol=1e-9)
    np.testing.assert_allclose(a.quaternions, b.quaternions, atol=1e-9)


@pytest.mark.parametrize("model", ["smpl", "smplh", "smplx"])
def test_a_body_model_gives_the_skeleton(model: str, tmp_path: Path) -> None:
    width = {"smpl": 72, "smplh": 156, "smplx": 165}[model]
    content = toy_model(model, 400 if model == "smplx" else 10)
    path = write(tmp_path / "model.npz", content | {"part2num": np.array({"a": 1}, dtype=object)})
    motion = smpl_motion(width=width)
    betas = motion["betas"]
    human = read_human(write(tmp_path / "clip.npz", motion), body_model=path)
    used = 16 if model == "smplx" else 10
    joints = content["J_regressor"] @ (content["v_template"] + content["shapedirs"][..., :used] @ betas[:used])
    assert human.names == JOINTS[model]
    np.testing.assert_allclose(human.positions[0, 0], joints[0] + motion["trans"][0], atol=1e-12)
    for j, parent in enumerate(parents(model)[1:], start=1):
        length = np.linalg.norm(human.positions[3, j] - human.positions[3, parent])
        assert length == pytest.approx(np.linalg.norm(joints[j] - joints[parent]), abs=1e-12)


def test_a_model_of_the_mean_body_is_the_mean_skeleton(tmp_path: Path) -> None:
    path = write(tmp_path / "model.npz", toy_model("smpl"))
    motion = smpl_motion(width=72) | {"betas": np.zeros(10)}
    clip = write(tmp_path / "clip.npz", motion)
    np.testing.assert_allclose(read_human(clip, body_model=path).positions, read_human(clip).positions, atol=1e-9)


class FakeCsc:
    """Pickles as scipy.sparse.csc.csc_matrix did under Python 2: a class, and a dictionary of its fields."""

    def __init__(self, matrix: Any) -> None:
        self.__dict__ = {"_shape": matrix.shape, "data": matrix.data, "indices": matrix.indices}
        self.__dict__ |= {"indptr": matrix.indptr, "maxprint": 50, "format": "csc"}


def pickled(content: dict[str, Any], protocol: int, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """A SMPL pickle: the regressor a sparse matrix, the directions a chumpy array."""

    class Ch:
        def __init__(self, x: np.ndarray) -> None:
            self.x = x

    monkeypatch.setitem(sys.modules, "chumpy", types.ModuleType("chumpy"))
    for module, name, kind in (("scipy.sparse.csc", "csc_matrix", FakeCsc), ("chumpy.ch", "Ch", Ch)):
        fake = types.ModuleType(module)
        kind.__module__, kind.__qualname__ = module, name
        setattr(fake, name, kind)
        monkeypatch.setitem(sys.modules, module, fake)
    return pickle.dumps(
        content
        | {
            "J_regressor": FakeCsc(sparse.csc_matrix(content["J_regressor"])),
            "shapedirs": Ch(content["shapedirs"]),
            "bs_type": "lrotmin",
        },
        protocol=protocol,
    )


@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_a_pickled_model_is_read_without_its_classes(
    protocol: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = toy_model("smpl")
    with monkeypatch.context() as patch:
        (tmp_path / "model.pkl").write_bytes(pickled(content, protocol, patch))
    betas = np.arange(10) / 10
    write(tmp_path / "model.npz", content)
    a, b = load_body_model(tmp_path / "model.pkl"), load_body_model(tmp_path / "model.npz")
    np.testing.assert_allclose(a.joints(betas), b.joints(betas), atol=1e-12)
    assert a.height(betas) == pytest.approx(b.height(betas))


class Runs:
    def __reduce__(self) -> Any:
        return print, ("this ran",)


def changed(**entries: Any) -> dict[str, Any]:
    content = smpl_motion() | entries
    return {key: value for key, value in content.items() if value is not None}


NAN = smpl_motion()["trans"].copy()
NAN[7, 1] = np.nan
BROKEN = {
    "no translation": (changed(trans=None), "no trans or transl"),
    "no root": (changed(poses=None, pose_body=np.zeros((30, 63))), "no root_orient or global_orient"),
    "a wrong width": (changed(poses=np.zeros((30, 150))), "150 wide; expected 72 (SMPL), 156"),
    "a wrong number of frames": (changed(trans=np.zeros((29, 3))), "30 frames of poses and 29 of trans"),
    "parts of other lengths": (
        changed(poses=None, root_orient=np.zeros((30, 3)), pose_body=np.zeros((29, 63))), "30 and 29 frames"),
    "no frames": (changed(poses=np.zeros((0, 165)), trans=np.zeros((0, 3))), "no frames"),
    "not a number": (changed(trans=NAN), "frame 7: trans has values that are not finite"),
    "text": (changed(poses=np.array(["a"] * 30)), "not numbers"),
    "no frame rate": (changed(mocap_frame_rate=None), "set --fps"),
    "a frame rate of zero": (changed(mocap_frame_rate=0), "a frame rate of 0"),
    "two frame rates": (changed(mocap_frame_rate=[1, 2]), "expected one number"),
    "an unknown model": (changed(surface_model_type="mano"), "surface_model_type is 'mano'"),
    "another model": (changed(surface_model_type="smplh"), "says SMPL-H, but the poses are 165 wide as of SMPL-X"),
    "a giant": (changed(betas=[50.0]), "betas[0] is 50"),
    "betas that are none": (changed(betas=np.zeros((2, 2, 2))), "betas has shape (2, 2, 2)"),
    "objects": (changed(poses=np.array([{}] * 30, dtype=object)), "'poses.npy' holds Python objects"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_broken_files_say_what_is_wrong(what: str, tmp_path: Path) -> None:
    content, message = BROKEN[what]
    path = write(tmp_path / "clip.npz", content)
    with pytest.raises(ClipError, match=re.escape(message)) as caught:
        read_human(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def bent(key: str, value: Any) -> dict[str, Any]:
    return toy_model() | {key: value}


BROKEN_MODELS = {
    "a key missing": ({"v_template": np.zeros((4, 3))}, "has no J_regressor"),
    "another tree": (bent("kintree_table", np.zeros((2, 24), dtype=int)), "not the tree of SMPL"),
    "another number of joints": (bent("kintree_table", np.zeros((2, 20), dtype=int)), "of 20 joints"),
    "a regressor of another size": (bent("J_regressor", np.zeros((24, 7))), "J_regressor is of shape (24, 7)"),
    "directions of another size": (bent("shapedirs", np.zeros((7, 3, 10))), "shapedirs is of shape (7, 3)"),
    "vertices that are not finite": (bent("v_template", np.full((VERTICES, 3), np.nan)), "v_template has values"),
    "text": (bent("v_template", np.array("x")), "v_template is not an array of numbers"),
    "another kind": (toy_model("smplh"), "the motion is of SMPL and the body model is SMPL-H"),
}


@pytest.mark.parametrize("what", BROKEN_MODELS)
def test_broken_models_say_what_is_wrong(what: str, tmp_path: Path) -> None:
    content, message = BROKEN_MODELS[what]
    smpl_file(tmp_path / "clip.npz")
    with pytest.raises(ClipError, match=re.escape(message)):
        read_human(tmp_path / "clip.npz", body_model=write(tmp_path / "model.npz", content))


def test_a_model_that_runs_code_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    smpl_file(tmp_path / "clip.npz")
    for data in (pickle.dumps({"J_regressor": Runs()}), b"\x80garbage", b"", b"PK\x03\x04rubbish"):
        (tmp_path / "model.pkl").write_bytes(data)
        with pytest.raises(ClipError, match=r"body model .*model\.pkl"):
            read_human(tmp_path / "clip.npz", body_model=tmp_path / "model.pkl")
    with pytest.raises(ClipError, match="cannot read"):
        read_human(tmp_path / "clip.npz", body_model=tmp_path / "none.pkl")
    assert "this ran" not in capsys.readouterr().out


def test_a_sparse_matrix_that_points_outside_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = toy_model("smpl")
    matrix = sparse.csc_matrix(content["J_regressor"])
    with monkeypatch.context() as patch:
        data = pickled(content, 2, patch)
    far = matrix.indices.copy()
    far[3] = 10_000
    assert matrix.indices.tobytes() in data
    (tmp_path / "model.pkl").write_bytes(data.replace(matrix.indices.tobytes(), far.tobytes()))
    with pytest.raises(ClipError, match="damaged sparse matrix"):
        load_body_model(tmp_path / "model.pkl")


def test_a_pickle_disguised_as_npz_is_refused(tmp_path: Path) -> None:
    (tmp_path / "clip.npz").write_bytes(pickle.dumps(smpl_motion()))
    with pytest.raises(ClipError, match="a pickle, which is not read as a human motion"):
        read_human(tmp_path / "clip.npz")
    assert not is_human(tmp_path / "clip.npz")


def test_recorded_motions_stand_on_the_floor(data_dir: Path) -> None:
    paths = sorted((data_dir / "smpl_npz").glob("*.npz"))
    assert len(paths) == 4
    for path in paths:
        human = read_human(path)
        assert (human.rig, human.fps) == ("smpl", 30.0)
        feet = human.positions[:, [human.index("left_foot"), human.index("right_foot")], 2]
        assert -0.03 < np.quantile(feet, 0.1) < 0.08
        assert 1.3 < np.median(human.positions[:, human.index("head"), 2]) < 1.6


def test_joints_that_smpl_itself_gave_fit_these_orientations(data_dir: Path) -> None:
    """PHC kept the joints of the SMPL model, of another shape, for the same motions: rigid in our joint frames."""
    for path in sorted((data_dir / "smpl_npz").glob("*.npz")):
        human = read_human(path)
        (other,) = (data_dir / "phc_pkl").glob(f"*{path.stem}.pkl")
        content, _ = safe_pickle.load(other.read_bytes())
        joints = next(iter(content.values()))["smpl_joints"]  # (T, 24, 3)
        shift = joints[:, 0] - human.positions[:, 0]
        assert np.ptp(shift, axis=0).max() < 1e-6
        for j, parent in enumerate(human.parents[1:], start=1):
            turn = Rotation.from_quat(human.quaternions[:, parent], scalar_first=True)
            bone = turn.apply(joints[:, j] - joints[:, parent], inverse=True)
            assert np.ptp(bone, axis=0).max() < 1e-4
