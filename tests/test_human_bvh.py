"""BVH files: kinematics against plain matrices, texts of all kinds, and what unit and vertical axis come out as."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from human_files import STANDING, XSENS, Bone, bvh, columns, walk, z_up
from hypothesis import given, settings
from hypothesis import strategies as st

from gmr_traj.exceptions import ClipError
from gmr_traj.formats.human import is_human, read_human
from gmr_traj.formats.human.bvh import read
from gmr_traj.formats.human.frame_rate import frame_rate
from gmr_traj.human_motion import HumanMotion

ORDERS = ["".join(order) for order in ("ZYX", "XYZ", "YXZ", "ZXY", "ZXZ", "Y", "XZ", "")]


def elementary(channel: str, value: float) -> np.ndarray:
    """The 4x4 matrix of one channel."""
    matrix, axis = np.eye(4), "XYZ".index(channel[0])
    if channel.endswith("position"):
        matrix[axis, 3] = value
        return matrix
    c, s = np.cos(np.radians(value)), np.sin(np.radians(value))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def by_matrices(bones: list[Bone], row: np.ndarray) -> dict[str, np.ndarray]:
    """World matrices of a frame, joint by joint and channel by channel."""
    world: dict[str, np.ndarray] = {}
    values = iter(row)
    for bone in bones:
        parts = {channel: next(values) for channel in bone.channels.split()}
        local = np.eye(4)
        local[:3, 3] = bone.offset
        for channel, value in parts.items():
            if channel.endswith("position"):
                local["XYZ".index(channel[0]), 3] = value
        for channel, value in parts.items():
            if channel.endswith("rotation"):
                local = local @ elementary(channel, value)
        world[bone.name] = (world[bone.parent] if bone.parent else np.eye(4)) @ local
    return world


def matrices(quaternions: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternions
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@st.composite
def skeletons(draw: st.DrawFn) -> tuple[list[Bone], np.ndarray]:
    """Any tree, any channels on any joint, and three frames of values."""
    numbers = st.floats(-200, 200).map(lambda x: round(x, 6))
    bones = []
    for k in range(draw(st.integers(1, 6))):
        moved = draw(st.permutations("XYZ"))[: draw(st.integers(0, 3))]
        order = draw(st.sampled_from(ORDERS[:5] if k == 0 else ORDERS))
        channels = [f"{axis}position" for axis in moved]
        turns = [f"{axis}rotation" for axis in order if order != "ZXZ"]
        at = draw(st.integers(0, len(channels)))
        bones.append(
            Bone(
                f"j{k}",
                "" if k == 0 else f"j{draw(st.integers(max(0, k - 2), k - 1))}",
                [draw(numbers) for _ in range(3)],
                " ".join([*channels[:at], *turns, *channels[at:]]),
            )
        )
    # The file lists joints depth first.
    ordered: list[Bone] = []

    def visit(bone: Bone) -> None:
        ordered.append(bone)
        for child in bones:
            if child.parent == bone.name:
                visit(child)

    visit(bones[0])
    if not columns(ordered):
        ordered[0] = ordered[0]._replace(channels="Yrotation")
    values = [[draw(numbers) for _ in columns(ordered)] for _ in range(3)]
    return ordered, np.array(values)


@settings(max_examples=60)
@given(skeletons())
def test_kinematics_are_those_of_plain_matrices(skeleton: tuple[list[Bone], np.ndarray]) -> None:
    bones, values = skeleton
    raw = read(bvh(bones, values).encode())
    assert raw.names == tuple(bone.name for bone in bones)
    for t, row in enumerate(values):
        world = by_matrices(bones, row)
        for j, bone in enumerate(bones):
            np.testing.assert_allclose(raw.positions[t, j], world[bone.name][:3, 3], atol=1e-8)
            np.testing.assert_allclose(matrices(raw.quaternions[t, j]), world[bone.name][:3, :3], atol=1e-9)


def test_proper_euler_angles_too() -> None:
    bones = [Bone("a", "", (1, 2, 3), "Zrotation Xrotation Zrotation")]
    raw = read(bvh(bones, np.array([[10.0, 20.0, 30.0]])).encode())
    expected = elementary("Z", 10) @ elementary("X", 20) @ elementary("Z", 30)
    np.testing.assert_allclose(matrices(raw.quaternions[0, 0]), expected[:3, :3], atol=1e-12)
    np.testing.assert_allclose(raw.positions[0, 0], (1, 2, 3))


def write(tmp_path: Path, text: str, encoding: str = "utf-8") -> Path:
    path = tmp_path / "clip.bvh"
    path.write_bytes(text.encode(encoding))
    return path


def same(a: HumanMotion, b: HumanMotion, tolerance: float = 1e-7) -> None:
    assert (a.names, a.rig, a.fps, a.parents) == (b.names, b.rig, b.fps, b.parents)
    np.testing.assert_allclose(a.positions, b.positions, atol=tolerance)
    np.testing.assert_allclose(a.quaternions, b.quaternions, atol=tolerance)
    assert a.height == pytest.approx(b.height, abs=1e-6)


def a_number_on_a_line(text: str) -> str:
    at = text.index("MOTION")
    return text[:at] + "\n".join(text[at:].split(" "))


TEXTS = {
    "other line ends": lambda text: text.replace("\n", "\r\n"),
    "a byte order mark": lambda text: "\ufeff" + text,
    "everything on one line": lambda text: " ".join(text.split()),
    "a number on a line": a_number_on_a_line,
    "braces beside names": lambda text: re.sub(r"\s*\{", "{", text),
    "lower case": lambda text: text.replace("JOINT", "Joint").replace("CHANNELS", "Channels"),
    "upper case": lambda text: text.replace("rotation", "ROTATION").replace("Frames", "FRAMES"),
    "spaces before colons": lambda text: text.replace("Frames:", "Frames :").replace("Frame Time:", "Frame  Time :"),
    "exponents": lambda text: text.replace(" 0.910000000", " 9.1e-1"),
}


@pytest.mark.parametrize("change", TEXTS)
def test_texts_of_all_kinds_are_the_same_motion(change: str, tmp_path: Path) -> None:
    text = bvh(XSENS, walk())
    reference = read_human(write(tmp_path, text))
    path = write(tmp_path, TEXTS[change](text))
    assert is_human(path)
    same(read_human(path), reference, 1e-12)


def test_names_in_another_code_page(tmp_path: Path) -> None:
    path = write(tmp_path, bvh(XSENS, walk()).replace("LeftToe", "LinkeZ\u00e4hen"), "latin-1")
    assert "LinkeZ\u00e4hen" in read_human(path).names


@pytest.mark.parametrize("unit, scale", [("m", 1.0), ("cm", 100.0), ("mm", 1000.0), ("in", 1 / 0.0254)])
@pytest.mark.parametrize("axis", ["y", "z"])
def test_unit_and_vertical_axis_are_found(unit: str, scale: float, axis: str, tmp_path: Path) -> None:
    reference = read_human(write(tmp_path, bvh(XSENS, walk())))
    values = walk() if axis == "y" else z_up(walk())
    human = read_human(write(tmp_path, bvh(XSENS, values, scale=scale)))
    same(human, reference, 2e-6)
    assert any(note.startswith(f"unit {unit}:") for note in human.notes)
    assert any(note.startswith(f"up is {axis}:") for note in human.notes)
    # and they can be said
    same(read_human(write(tmp_path, bvh(XSENS, values, scale=scale)), unit=unit, up=axis), reference, 2e-6)


def test_what_comes_out(tmp_path: Path) -> None:
    human = read_human(write(tmp_path, bvh(XSENS, walk())))
    assert human.rig == "xsens"
    assert human.fps == 30.0
    assert human.height == pytest.approx(STANDING / 0.89, abs=1e-3)
    hips, head = human.positions[:, human.index("Hips")], human.positions[:, human.index("Head")]
    # (x, y, z) of the file is (x, -z, y): up is z, and walking along the file's z is walking along -y
    np.testing.assert_allclose(hips[0], (0.2, 0.0, 0.91), atol=1e-6)
    assert hips[-1, 1] < -1.0
    assert (head[:, 2] > 1.4).all()
    np.testing.assert_allclose(matrices(human.quaternions[0, 0]), [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-7)
    assert set(human.contacts) == {"LeftAnkle", "RightAnkle", "LeftToe", "RightToe"}


def test_a_prefix_and_another_spelling(tmp_path: Path) -> None:
    text = bvh(XSENS, walk())
    names = (
        "Pelvis L5 L3 T12 T8 Neck Head Right_Shoulder Right_Upper_Arm Right_Forearm Right_Hand Left_Shoulder "
        "Left_Upper_Arm Left_Forearm Left_Hand Right_Upper_Leg Right_Lower_Leg Right_Foot Right_Toe Left_Upper_Leg "
        "Left_Lower_Leg Left_Foot Left_Toe"
    ).split()
    renamed = {bone.name: f"actor:{name}" for bone, name in zip(XSENS, names, strict=True)}
    bones = [b._replace(name=renamed[b.name], parent=renamed.get(b.parent, "")) for b in XSENS]
    human = read_human(write(tmp_path, bvh(bones, walk())))
    same(human, read_human(write(tmp_path, text)))
    assert any("Pelvis is Hips" in note for note in human.notes)


def test_the_same_names_with_other_frames_are_another_rig(tmp_path: Path) -> None:
    bones = [b._replace(offset=(0, 0, -0.43)) if b.name.endswith("Knee") else b for b in XSENS]
    human = read_human(write(tmp_path, bvh(bones, walk())))
    assert human.rig == "unknown"
    assert any("names of rig xsens, but other frames" in note for note in human.notes)
    assert read_human(write(tmp_path, bvh(bones, walk())), rig="xsens").rig == "xsens"


def test_an_unknown_rig_is_read(tmp_path: Path) -> None:
    text = bvh(XSENS, walk()).replace("Chest2", "Belly").replace("Ankle", "Foot")
    human = read_human(write(tmp_path, text))
    assert human.rig == "unknown"
    assert human.height == pytest.approx(STANDING / 0.89, abs=1e-3)
    assert set(human.contacts) == {"LeftFoot", "RightFoot", "LeftToe", "RightToe"}


def test_a_small_person_needs_the_height(tmp_path: Path) -> None:
    path = write(tmp_path, bvh(XSENS, walk(), scale=0.6))
    with pytest.raises(ClipError, match="set --unit"):
        read_human(path)
    assert read_human(path, height=1.0).height == 1.0
    assert read_human(path, unit="m").height == pytest.approx(0.6 * STANDING / 0.89, abs=1e-3)


def test_lying_still_does_not_tell_what_is_up(tmp_path: Path) -> None:
    text = bvh(XSENS, np.tile(walk()[:1], (5, 1))).replace("Chest2", "Belly")
    values = np.zeros((5, len(columns(XSENS))))
    values[:, 5] = 90.0  # about z: the person lies along x
    with pytest.raises(ClipError, match="set --up"):
        read_human(write(tmp_path, bvh(XSENS, values).replace("Chest2", "Belly")))
    assert read_human(write(tmp_path, text)).positions[0, 0, 2] == pytest.approx(0.91)


def test_crawling_along_z_is_not_standing(tmp_path: Path) -> None:
    values = np.zeros((60, len(columns(XSENS))))
    values[:, 1], values[:, 2] = 0.3, np.linspace(0, 6, 60)
    values[:, 3] = 90.0  # about x: face down, head along z
    human = read_human(write(tmp_path, bvh(XSENS, values).replace("Chest2", "Belly")))
    assert any(note.startswith("up is y: the lowest joint") for note in human.notes)


@pytest.mark.parametrize(
    "text, fps",
    [
        ("0.033333", 30), (".0083333", 120), ("0.0333333", 30), ("0.0333", 30), ("0.033", 30), ("0.016667", 60),
        ("0.016666", 60), ("0.00833333", 120), ("0.01", 100), ("0.02", 50), ("0.04", 25), ("0.041667", 24),
        ("0.0166667", 60), ("0.033367", 30000 / 1001), ("0.0417083", 24000 / 1001), ("8.33333e-3", 120), ("1", 1),
        ("0.008333", 120), ("0.005", 200), ("0.004167", 240), ("0.0142857", 1 / 0.0142857), ("0.05", 20),
    ],
)  # fmt: skip
def test_frame_rates(text: str, fps: float) -> None:
    assert frame_rate(text)[0] == pytest.approx(fps, rel=1e-12)


def test_a_frame_time_that_says_too_little() -> None:
    rate, note = frame_rate("0.03")
    assert rate == pytest.approx(1 / 0.03)
    assert "set --fps" in note


@pytest.mark.parametrize(
    "text", ["0", "0.0", "-0.0333", "nan", "inf", "x", "", "0,0333", "1e-9", "1e999", "30fps", "."]
)
def test_no_frame_times(text: str) -> None:
    with pytest.raises(ClipError, match="Frame Time is"):
        frame_rate(text)


SOUND = bvh(XSENS, walk(4))
BROKEN = {
    "cut in the hierarchy": (SOUND[:700], "no MOTION section"),
    "cut in the motion": (SOUND[:-40], "the file is cut"),
    "cut before the frames": (SOUND[: SOUND.index("Frame Time")], "MOTION starts with"),
    "no frames": (SOUND.replace("Frames: 4", "Frames: 0"), "Frames is 0"),
    "a wrong count": (SOUND.replace("Frames: 4", "Frames: 5"), "Frames: 5 of 72 channels"),
    "a count that is none": (SOUND.replace("Frames: 4", "Frames: -4"), "Frames is '-4'"),
    "a missing frame time": (SOUND.replace("Frame Time: 0.033333", ""), "expected 'Frames: <count> Frame Time"),
    "frame time zero": (SOUND.replace("0.033333", "0.0", 1), "Frame Time is '0.0'"),
    "frame time below zero": (SOUND.replace("Time: 0.033333", "Time: -0.1"), "Frame Time is '-0.1'"),
    "a value that is none": (SOUND.replace("0.910000000", "abc", 1), "frame 0: Yposition of 'Hips' is 'abc'"),
    "not a number": (SOUND.replace("0.910000000", "nan", 1), "frame 0: Yposition of 'Hips' is 'nan'"),
    "a value that is infinite": (SOUND.replace("0.910000000", "1e999", 1), "frame 0: Yposition of 'Hips' is '1e999'"),
    "a missing channel": (SOUND.replace("CHANNELS 3 ", "CHANNELS 4 ", 1), "expected Xposition"),
    "a channel too many": (SOUND.replace("CHANNELS 3 ", "CHANNELS 2 ", 1), "has 'Zrotation'; expected OFFSET"),
    "an unknown channel": (SOUND.replace("Yrotation", "Yscale", 1), "a channel 'Yscale'"),
    "a repeated channel": (SOUND.replace("Xposition", "Yposition", 1), "repeats a channel"),
    "nine channels": (SOUND.replace("CHANNELS 6", "CHANNELS 9", 1), "9 channels"),
    "no offset": (re.sub(r"OFFSET \S+ \S+ \S+", "", SOUND, count=1), "'Hips' has no OFFSET"),
    "a short offset": (re.sub(r"OFFSET \S+ \S+ \S+", "OFFSET 1 2", SOUND, count=1), "OFFSET of 'Hips' is 'CHANNELS'"),
    "an offset of no length": (re.sub(r"OFFSET \S+", "OFFSET 1e30", SOUND, count=1), "which is no length"),
    "a name twice": (SOUND.replace("LeftToe", "RightToe"), "'RightToe' is named twice"),
    "no name": (SOUND.replace("LeftToe", ""), "a joint has no name"),
    "two people": (SOUND.replace("MOTION", "ROOT Other\n{\n}\nMOTION"), "a second ROOT"),
    "an unbalanced brace": (SOUND.replace("}\nMOTION", "MOTION"), "a brace or the end is missing"),
    "a brace too many": (SOUND.replace("MOTION", "}\nMOTION"), "goes on with '}'"),
    "no root": (SOUND.replace("ROOT", "JOINT", 1), "'JOINT' where ROOT should be"),
    "nothing that moves": ("HIERARCHY ROOT a { OFFSET 0 0 0 } MOTION Frames: 1 Frame Time: 1", "nothing moves"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_broken_files_say_what_is_wrong(what: str, tmp_path: Path) -> None:
    text, message = BROKEN[what]
    assert text != SOUND
    path = write(tmp_path, text)
    with pytest.raises(ClipError) as caught:
        read_human(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"unit": "foot"}, "there is no unit 'foot'"),
        ({"unit": "cm"}, "would be 0.0"),
        ({"up": "x"}, "there is no vertical axis 'x'"),
        ({"fps": 0.0}, "a frame rate of 0"),
        ({"height": 17.0}, "a height of 17 m"),
        ({"rig": "lafan1"}, "rig lafan1 has a joint 'LeftFoot'"),
        ({"body_model": "SMPL_NEUTRAL.pkl"}, "leave --body-model out"),
    ],
)
def test_options_that_do_not_fit(options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(ClipError, match=re.escape(message)):
        read_human(write(tmp_path, SOUND), **options)


def test_recorded_walk_of_lafan1(data_dir: Path) -> None:
    human = read_human(data_dir / "lafan1_bvh" / "walk1_subject1_walk2.bvh")
    assert (human.rig, human.fps, human.frames) == ("lafan1", 30.0, 455)
    assert human.height == pytest.approx(1.75, abs=0.002)
    at = {name: human.positions[:, human.index(name)] for name in human.names}
    for name in ("LeftToe", "RightToe"):
        assert abs(np.quantile(at[name][:, 2], 0.1)) < 0.03  # on the floor
    for bone, end in (("UpLeg", "Leg"), ("Leg", "Foot"), ("Foot", "Toe"), ("Arm", "ForeArm"), ("ForeArm", "Hand")):
        left, right = (np.linalg.norm(at[s + end] - at[s + bone], axis=1) for s in ("Left", "Right"))
        np.testing.assert_allclose(left, right, atol=2e-5)
        assert np.ptp(left) < 1e-6
    # The person walks where the toes point: velocity along (left - right hip) x up.
    across = at["LeftUpLeg"] - at["RightUpLeg"]
    ahead = np.cross(across, [0, 0, 1.0])
    velocity = np.gradient(at["Hips"], 1 / 30, axis=0)
    speed = np.sum(velocity[:, :2] * ahead[:, :2], axis=1) / np.linalg.norm(ahead[:, :2], axis=1)
    assert np.median(speed) > 0.3
    for side in ("Left", "Right"):
        toes = at[f"{side}Toe"] - at[f"{side}Foot"]
        assert np.median(np.sum(toes[:, :2] * ahead[:, :2], axis=1)) > 0


def test_recorded_clips_of_cmu(data_dir: Path) -> None:
    for path in sorted((data_dir / "cmu_bvh").glob("*.bvh")):
        human = read_human(path)
        assert (human.rig, human.fps) == ("cmu", 120.0)
        assert 1.4 < human.height < 1.9
        low = np.quantile(human.positions[:, human.index("LeftToe"), 2], 0.1)
        assert abs(low) < 0.08
