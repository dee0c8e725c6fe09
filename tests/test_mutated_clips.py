"""Damaged and doctored files of every format: each is read or refused with one of our errors, and no half file is left.

Two kinds of damage: bytes cut, flipped, removed, repeated; and fields of an otherwise sound file removed, renamed,
reshaped, retyped, or filled with values no motion has.
"""

from __future__ import annotations

import io
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pytest
from clip_files import FILES, squats
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats import FORMATS, read_clip, write_clip
from gmr_traj.robot_loading import load_robot

G1 = load_robot("unitree_g1")
NAMES = sorted(FILES)
QPOS = squats(G1, frames=6)

FAST = settings(max_examples=17, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
SLOW = settings(FAST, max_examples=120)  # 9 formats x 120: more than a thousand
# A warning in the user's terminal would be a check that is missing.
pytestmark = pytest.mark.filterwarnings("error")


def sound(name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"in{FILES[name][1]}"
        FILES[name][0](G1, QPOS, path)
        return path.read_bytes()


SOUND = {name: sound(name) for name in NAMES}


@st.composite
def damaged(draw: st.DrawFn, sound: bytes) -> bytes:
    """Bytes cut, flipped, removed, repeated, inserted or swapped in up to three places."""
    data = bytearray(sound)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        length = draw(st.integers(1, 40))
        match draw(st.sampled_from(["cut", "flip", "remove", "repeat", "insert", "swap"])):
            case "cut":
                del data[at:]
            case "flip" if data:
                data[at] ^= draw(st.integers(1, 255))
            case "remove":
                del data[at : at + length]
            case "repeat":
                data[at:at] = data[at : at + length]
            case "insert":
                data[at:at] = draw(st.binary(max_size=12))
            case _:
                data[at : at + length] = data[at : at + length][::-1]
    return bytes(data)


def damaged_bytes(name: str) -> st.SearchStrategy[bytes]:
    return damaged(SOUND[name])


ODD_VALUES = st.sampled_from(
    [np.nan, np.inf, -np.inf, 1e308, -1e300, 1e7, 1e-320, 0.0, -1.0, 100.0, 57.3, "x", None, [], {}, 2**70, "0", True]
)


def doctored_value(draw: st.DrawFn, value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return draw(ODD_VALUES)
    array = np.array(value)
    match draw(
        st.sampled_from(["set", "scale", "cut", "columns", "type", "axis", "value", "repeat", "empty", "shuffle"])
    ):
        case "set" if array.size and array.dtype.kind == "f":
            bad = draw(st.sampled_from([np.nan, np.inf, 1e308, 1e9, 7.0, -2.0, 0.0]))
            with np.errstate(over="ignore"):
                array.reshape(-1)[draw(st.integers(0, array.size - 1))] = bad
        case "scale" if array.dtype.kind == "f":
            with np.errstate(all="ignore"):
                array = array * array.dtype.type(draw(st.sampled_from([0.0, 0.5, -1.0, 57.3, 100.0, 1e30])))
        case "cut":
            array = array[: draw(st.integers(0, 3))] if array.ndim else array
        case "columns":
            array = array[..., draw(st.integers(0, 3)) :] if array.ndim else array
        case "type":
            kind = draw(st.sampled_from(["f2", "f4", "i4", "u1", "c16", "?", "U5", "M8[s]"]))
            with np.errstate(all="ignore"):
                array = array.astype(kind) if array.dtype.kind not in "UcO" else array
        case "axis":
            array = array[..., None] if draw(st.booleans()) else array.T
        case "value":
            return draw(ODD_VALUES)
        case "repeat":
            array = np.repeat(array, 2, axis=0) if array.ndim else array
        case "shuffle":
            array = np.roll(array, draw(st.integers(1, 3)), axis=-1) if array.ndim else array
        case _:
            array = array[..., :0] if array.ndim else array
    return array


@st.composite
def doctored(draw: st.DrawFn, name: str) -> bytes:
    """A sound container whose fields are not."""
    if name.endswith("csv"):
        return doctored_csv(draw, SOUND[name].decode())
    ending = FILES[name][1]
    if ending == ".npz":
        with np.load(io.BytesIO(SOUND[name])) as archive:
            content: dict[Any, Any] = {key: archive[key] for key in archive.files}
    else:
        content = joblib.load(io.BytesIO(SOUND[name]))
    inner = content["a_walk"] if name == "phc" else content
    for _ in range(draw(st.integers(1, 2))):
        key = draw(st.sampled_from(sorted(inner))) if inner else "none"
        match draw(st.sampled_from(["value", "value", "value", "remove", "rename", "add"])):
            case "remove":
                inner.pop(key, None)
            case "rename" if inner:
                inner[draw(st.sampled_from(["qpos", "poses", "robot", "fps", "cost", "contacts", "a/../b"]))] = (
                    inner.pop(key)
                )
            case "add":
                field = draw(
                    st.sampled_from(["contacts", "robot", "joint_names", "human_joints", "reference_names", "x"])
                )
                inner[field] = draw(ODD_VALUES)
            case _ if inner:
                inner[key] = doctored_value(draw, inner[key])
    stream = io.BytesIO()
    if ending == ".npz":
        plain = {key: np.asarray(value) for key, value in content.items()}
        np.savez(stream, **plain)  # objects are pickled, as a careless script does
    elif draw(st.booleans()):
        joblib.dump(content, stream)
    else:
        pickle.dump(content, stream)
    return stream.getvalue()


def doctored_csv(draw: st.DrawFn, text: str) -> bytes:
    lines = [line.split(",") for line in text.splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        line = draw(st.integers(0, len(lines) - 1))
        column = draw(st.integers(0, max(len(lines[line]) - 1, 0)))
        match draw(st.sampled_from(["cell", "cell", "drop", "column", "header", "repeat"])):
            case "drop" if len(lines) > 1:
                del lines[line]
            case "column":
                lines = [row[:column] + row[column + 1 :] for row in lines]
            case "header":
                lines.insert(0, draw(st.sampled_from([["Frame"], ["a", "b"], lines[0], [""]])))
            case "repeat":
                lines.append(lines[line])
            case _:
                cell = draw(
                    st.sampled_from(["nan", "inf", "1e400", "", "x", "-1", "9" * 400, "1;2", '"', "0x10", "\x00", "é"])
                )
                lines[line][column : column + 1] = [cell]
    return "\n".join(",".join(row) for row in lines).encode()


def check(data: bytes, target: str | None) -> None:
    """A file is read and written, or refused; a refusal leaves no file, and neither leaves another."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "in", Path(folder) / "out" / "clip"
        path.write_bytes(data)
        out.parent.mkdir()
        try:
            clip = read_clip(path, G1)
            write_clip(clip, out, format=target, robot=G1)
        except GmrTrajError as error:
            assert str(path) in str(error) or str(out) in str(error)
            assert "\n" not in str(error)
            assert not list(out.parent.iterdir())
        else:
            assert [file.name for file in out.parent.iterdir()] == ["clip"]


DAMAGE: dict[str, Callable[[str], st.SearchStrategy[bytes]]] = {"bytes": damaged_bytes, "fields": doctored}
targets = st.sampled_from([None, *sorted(FORMATS)])


@pytest.mark.parametrize("name", NAMES)
@FAST
@given(draw=st.data())
def test_some(name: str, draw: st.DataObject) -> None:
    damage = DAMAGE[draw.draw(st.sampled_from(sorted(DAMAGE)))]
    check(draw.draw(damage(name)), draw.draw(targets))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@SLOW
@given(draw=st.data())
def test_a_thousand(name: str, draw: st.DataObject) -> None:
    damage = DAMAGE[draw.draw(st.sampled_from(sorted(DAMAGE)))]
    check(draw.draw(damage(name)), draw.draw(targets))


@pytest.mark.parametrize("name", NAMES)
def test_every_eighth(name: str) -> None:
    """Cut anywhere along the file."""
    data = SOUND[name]
    for eighth in range(8):
        check(data[: len(data) * eighth // 8], None)


def test_the_samples_are_sound() -> None:
    for name in NAMES:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "in"
            path.write_bytes(SOUND[name])
            assert read_clip(path, G1).format == name
