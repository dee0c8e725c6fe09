"""Damaged and doctored human motions: each is read or refused with one of our errors, and nothing else happens."""

from __future__ import annotations

import io
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from human_files import FILES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_mutated_clips import damaged, doctored_value

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.formats.human import is_human, read_human

NAMES = sorted(FILES)
FAST = settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
SLOW = settings(FAST, max_examples=1000)
# A warning in the user's terminal would be a check that is missing.
pytestmark = pytest.mark.filterwarnings("error")


def sound(name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"in{FILES[name][1]}"
        FILES[name][0](path)
        return path.read_bytes()


SOUND = {name: sound(name) for name in NAMES}
WORDS = st.sampled_from(
    ["", "nan", "-inf", "1e400", "1e308", "-1", "0", "99999999999", "{", "}", "[", "]", '"', "x", "End", "JOINT Hips {",
     "ROOT", "MOTION", "OFFSET 0 0 0", "CHANNELS 6", "CHANNELS 999999999999999999999", "Xposition", "Frames: 2", "é",
     "Frame Time: 0", "null", "[[", "\x00", "1_0"]
)  # fmt: skip


@st.composite
def doctored(draw: st.DrawFn, name: str) -> bytes:
    """A file whose container is sound and whose content is not."""
    if FILES[name][1] == ".npz":
        with np.load(io.BytesIO(SOUND[name]), allow_pickle=True) as archive:
            content: dict[str, Any] = dict(archive)
        for _ in range(draw(st.integers(1, 2))):
            key = draw(st.sampled_from(sorted(content)))
            if draw(st.integers(0, 3)):
                content[key] = doctored_value(draw, content[key])
            else:
                other = draw(
                    st.sampled_from(["poses", "betas", "rig", "contacts", "joint_parents", "surface_model_type"])
                )
                content[other] = content.pop(key)
        stream = io.BytesIO()
        np.savez(stream, **{key: np.asarray(value) for key, value in content.items()})
        return stream.getvalue()
    text = SOUND[name].decode()
    for _ in range(draw(st.integers(1, 3))):
        tokens = list(re.finditer(r"[^\s,]+", text))
        # Half of the time among the first, where the structure is.
        last = len(tokens) - 1 if draw(st.booleans()) else min(len(tokens) - 1, 300)
        token = tokens[draw(st.integers(0, last))]
        text = text[: token.start()] + draw(WORDS) + text[token.end() :]
    return text.encode()


def damage(draw: st.DataObject, name: str) -> bytes:
    return draw.draw(damaged(SOUND[name]) if draw.draw(st.booleans()) else doctored(name))


def check(data: bytes) -> None:
    """The file is a human motion of sound numbers, or is refused by name in one line."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "in"
        path.write_bytes(data)
        is_human(path)
        try:
            human = read_human(path)
        except GmrTrajError as error:
            assert str(path) in str(error)
            assert "\n" not in str(error)
        else:
            assert np.isfinite(human.positions).all()
            assert 0.3 < human.height < 3.1
            assert all(len(flags) == human.frames for flags in human.contacts.values())


@pytest.mark.parametrize("name", NAMES)
@FAST
@given(draw=st.data())
def test_some(name: str, draw: st.DataObject) -> None:
    check(damage(draw, name))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@SLOW
@given(draw=st.data())
def test_a_thousand(name: str, draw: st.DataObject) -> None:
    check(damage(draw, name))


@pytest.mark.parametrize("name", NAMES)
def test_every_sixteenth(name: str) -> None:
    """Cut anywhere along the file."""
    data = SOUND[name]
    for part in range(16):
        check(data[: len(data) * part // 16])


def test_the_samples_are_sound() -> None:
    for name in NAMES:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "in"
            path.write_bytes(SOUND[name])
            assert is_human(path)
            assert read_human(path).frames > 10
