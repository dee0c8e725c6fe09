"""Recordings, read back."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st
from limb_clips import HANDS, KNEES, on_all_fours
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from gmr_traj.contacts.detect import detect
from gmr_traj.exceptions import ClipError, GmrTrajError
from gmr_traj.formats import read_clip
from gmr_traj.human_motion import HumanMotion
from gmr_traj.metrics import certify
from gmr_traj.references import BodyTargets
from gmr_traj.robot import Capsule, Robot
from gmr_traj.track import ContactForces, Track, track
from gmr_traj.viewer import Scene, convergence, documents, save
from gmr_traj.viewer.artefact_lanes import SEVERITY, severity_colour
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.robot_geometry import capsule_rotation
from gmr_traj.viewer.timelines import Clock
from gmr_traj.viewer.window import command

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "punch.npz"


@pytest.fixture(scope="module")
def raw(g1: Robot) -> Track:
    return track("raw", read_clip(EXAMPLE, g1).motion, g1)


@pytest.fixture(scope="module")
def scene(raw: Track, g1: Robot) -> Scene:
    """Everything at once: three robots, forces, a person, targets, a certificate, a trace."""
    motion = raw.motion.with_qpos(raw.motion.qpos[::-1])
    points = np.concatenate(raw.observation.soles, axis=1)
    forces = ContactForces(points, np.broadcast_to([0.0, 0.0, 50.0], points.shape))
    names = ("pelvis", "torso_link", "left_ankle_roll_link")
    chosen = raw.observation.positions[:, [g1.body_names.index(name) for name in names]]
    still = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*chosen.shape[:2], 4))
    return Scene(
        title="everything",
        tracks=(
            raw,
            track("refined", motion, g1),
            track("rollout", raw.motion, g1, raw.schedule, forces=forces),
        ),
        certificate=certify(raw.motion, motion, g1, raw.schedule, levelling=0.0),
        trace={"obj": (1e3, 10.0, 9.0), "inf_pr": (1.0, 1e-4, 0.0), "inf_du": (10.0, 1.0, 1e-9)},
        human=HumanMotion("toy", names, (-1, 0, 0), 1.2 * chosen, still, 60.0, 1.8),
        targets=BodyTargets(names, chosen, still, np.ones(3), np.ones(3)),
    )


@pytest.fixture(scope="module")
def rows(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    """All chunks of the recording of everything, by entity."""
    path = tmp_path_factory.mktemp("recording") / "everything.rrd"
    save(scene, path, meshes=False)
    found = defaultdict(list)
    for chunk in RrdReader(path).stream():
        found[str(chunk.entity_path)].append(chunk)
    return found


def column(rows: dict[str, list], path: str, component: str, timeline: str = "time") -> tuple[np.ndarray, np.ndarray]:
    """Times and values of one component of an entity, in the order of time."""
    times, values = [], []
    for chunk in rows[path]:
        if timeline in chunk.timeline_names:
            table = chunk.to_record_batch()
            (name,) = [n for n in table.schema.names if n.endswith(component)]
            times += table.column(timeline).cast("int64").to_pylist()
            values += table.column(name).to_pylist()
    order = np.argsort(times, kind="stable")
    return np.array(times)[order], np.array([values[k] for k in order], dtype=object)


def test_bodies_are_where_they_are_in_every_frame(rows, scene):
    for shown in scene.tracks:
        for b, body in enumerate(shown.robot.body_names):
            path = f"/tf/{shown.name}/{body}"
            times, translation = column(rows, path, "translation")
            np.testing.assert_allclose(times, 1e9 * shown.time, atol=1.0)
            places = np.array([value[0] for value in translation], dtype=float)
            np.testing.assert_allclose(places, shown.observation.positions[:, b], atol=1e-6)
            _, quaternion = column(rows, path, "quaternion")
            turned = Rotation.from_quat(np.array([value[0] for value in quaternion], dtype=float)).as_matrix()
            np.testing.assert_allclose(turned, shown.observation.rotations[:, b], atol=1e-6)


def test_frames_count_at_the_first_clip_s_rate(rows, scene):
    frames, _ = column(rows, "/tf/raw/pelvis", "translation", "frame")
    assert frames.tolist() == list(range(scene.tracks[0].motion.frames))


def test_curves_are_the_signals(rows, scene):
    for shown in scene.tracks:
        for signal in shown.signals:
            _, values = column(rows, f"/signals/{signal.name}/{shown.name}", "scalars")
            np.testing.assert_array_equal([value[0] for value in values], signal.values)
    robot = scene.tracks[0].robot
    for j, joint in enumerate(robot.joint_names):
        _, upper = column(rows, f"/joints/{joint}/velocity/upper_limit", "scalars")
        assert {value[0] for value in upper} == {robot.velocity_limit[j]}


def test_the_highlight_holds_the_worst_artefact_and_what_held_before(rows, scene):
    begin, end = scene.highlight
    worst = scene.worst()
    assert begin < worst.begin and worst.end < end
    times, _ = column(rows, "/tf/raw/pelvis", "translation", "highlight")
    fps = scene.fps
    assert times[0] == pytest.approx(1e9 * begin, abs=1.0)
    inside = [t for t in scene.tracks[0].time if begin <= t <= end]
    assert len(times) == len(inside) + (inside[0] > begin + 1e-9)
    assert (np.diff(times) <= 1e9 / fps + 1).all()
    # Lanes are sparse; each still has a state, or none, from the beginning of the highlight on.
    for path in (path for path in rows if path.startswith(("/artefacts/raw/", "/stances/"))):
        times, _ = column(rows, path, "state", "highlight")
        assert times[0] == pytest.approx(1e9 * begin, abs=1.0), path


def test_lanes_are_the_stances_and_artefacts(rows, scene):
    down = {(s.sole, s.part): np.zeros(scene.tracks[-1].motion.frames, bool) for s in scene.tracks[-1].schedule.stances}
    for stance in scene.tracks[-1].schedule.stances:
        down[stance.sole, stance.part][stance.start : stance.stop] = True
    for (sole, side), expected in down.items():
        times, states = column(rows, f"/stances/{sole}_{side}", "state")
        np.testing.assert_array_equal(held(times, states, scene.fps, len(expected)) != "", expected)
    raw = scene.tracks[0]
    for kind in {a.kind for a in raw.artefacts if a.kind != "height"}:
        expected = np.zeros(raw.motion.frames, bool)
        for a in raw.artefacts:
            if a.kind == kind:
                expected[a.start : a.stop] = True
        times, states = column(rows, f"/artefacts/raw/{kind}", "state")
        np.testing.assert_array_equal(held(times, states, scene.fps, len(expected)) != "", expected)


def test_limbs_in_stance_have_lanes_points_and_anchors(g1: Robot, tmp_path: Path) -> None:
    crawling = track("refined", on_all_fours(g1, 20, step=False), g1)
    save(Scene("fours", (crawling,)), tmp_path / "fours.rrd", meshes=False)
    rows = defaultdict(list)
    for chunk in RrdReader(tmp_path / "fours.rrd").stream():
        rows[str(chunk.entity_path)].append(chunk)
    lanes = {path for path in rows if path.startswith("/stances/")}
    expected = {f"/stances/{name}" for name in HANDS + KNEES}
    assert expected <= lanes and "/stances/hips" not in lanes  # which never touch the floor
    _, points = column(rows, "/world/refined/soles/left_hand", "positions")
    _, anchors = column(rows, "/world/refined/anchors", "positions")
    assert len(anchors[0]) == len(crawling.schedule.stances)
    assert all(point[2] == 0.0 for point in anchors[0])
    assert min(point[2] for point in points[0]) == pytest.approx(0.0, abs=2e-3)


def held(times: np.ndarray, states: np.ndarray, fps: float, frames: int) -> np.ndarray:
    """The state in every frame: the latest that was logged."""
    changes = np.round(times * 1e-9 * fps).astype(int)
    found = np.full(frames, "", dtype=object)
    for change, state in zip(changes, states, strict=True):
        found[change:] = state[0]
    return found


def test_sparse_and_ragged_things_are_there(rows, scene):
    times, anchors = column(rows, "/world/refined/anchors", "positions")
    refined = scene.tracks[1]
    for time, points in zip(times, anchors, strict=True):
        frame = round(time * 1e-9 * scene.fps)
        assert len(points or []) == sum(s.start <= frame < s.stop for s in refined.schedule.stances)
        assert all(point[2] == 0.0 for point in points or [])
    _, forces = column(rows, "/world/rollout/forces", "vectors")
    assert np.shape(list(forces)) == (64, 2 * len(scene.tracks[0].robot.soles[0].points), 3)
    _, targets = column(rows, "/world/targets", "positions")
    assert np.shape(list(targets)) == (64, 3, 3)
    frames, roots = column(rows, "/tf/human", "translation", "frame")  # 60 Hz on a clock of 30 Hz
    assert frames.tolist() == [k // 2 for k in range(64)]
    np.testing.assert_allclose(
        np.array([root[0] for root in roots], dtype=float), scene.human.positions[:, 0], atol=1e-6
    )
    for path in ("/text/guide", "/text/worst", "/text/certificate", "/solver/obj", "/solver/inf_pr"):
        assert rows[path]
    assert f"/world/raw/shapes/{scene.tracks[0].robot.body_names[0]}" in rows


def test_the_viewer_s_own_check_finds_no_fault(scene, tmp_path):
    save(scene, tmp_path / "everything.rrd", meshes=False)
    done = subprocess.run(
        [sys.executable, "-m", "rerun_cli", "rrd", "verify", str(tmp_path / "everything.rrd")],
        env=dict(os.environ, RERUN_APP_ONLY="true"),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_recording_is_whole_or_not_there(raw, tmp_path, monkeypatch):
    monkeypatch.setattr(documents, "guide", lambda scene: 1 / 0)
    (tmp_path / "old.rrd").write_bytes(b"old")
    with pytest.raises(ZeroDivisionError):
        save(Scene("x", (raw,)), tmp_path / "old.rrd", meshes=False)
    assert os.listdir(tmp_path) == ["old.rrd"] and (tmp_path / "old.rrd").read_bytes() == b"old"
    with pytest.raises(GmrTrajError, match="there is no folder"):
        save(Scene("x", (raw,)), tmp_path / "absent" / "new.rrd", meshes=False)


@given(
    fps=st.floats(5.0, 120.0),
    count=st.integers(1, 60),
    window=st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)).map(sorted),
)
def test_the_highlight_s_rows_are_those_in_force(fps, count, window):
    sent = []

    class Stream:
        def send_columns(self, path, indexes, columns):
            sent.append((indexes, columns))

    seconds = np.arange(count) / fps
    Clock(30.0, tuple(window)).send(Stream(), "/x", seconds, lambda rows: rows.tolist())
    assert sent[0][1] == list(range(count))
    begin, end = window
    expected = [k for k in range(count) if begin <= seconds[k] <= end]
    earlier = [k for k in range(count) if seconds[k] < begin]
    if earlier and not (expected and seconds[expected[0]] == begin):
        expected = [earlier[-1], *expected]
    assert (sent[1][1] if len(sent) > 1 else []) == expected


def test_capsules_are_turned_to_their_axes():
    rng = np.random.default_rng(0)
    axes = [*rng.normal(size=(20, 3)), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]), np.zeros(3)]
    for axis in axes:
        capsule = Capsule("c", "b", np.zeros(3), 0.3 * axis, 0.1)
        turned = Rotation.from_quat(capsule_rotation(capsule)).apply([0.0, 0.0, np.linalg.norm(capsule.end)])
        np.testing.assert_allclose(turned, capsule.end, atol=1e-9)


def test_words_for_people(scene, raw):
    text = documents.guide(scene)
    worst = raw.worst()
    assert worst.where in text and "worst artefact" in text and "raised by 19 mm" in text
    table = documents.worst_artefacts(raw).splitlines()
    scores = [float(line.split("|")[-2]) for line in table[4:]]
    assert scores == sorted(scores, reverse=True) and len(scores) == len(raw.artefacts)
    assert documents.worst_artefacts(replace(raw, artefacts=())) == "**raw: no artefacts**"
    certificate = documents.certificate(scene.certificate)
    assert certificate.count("**BROKEN**") == len(scene.certificate.broken) > 0
    assert severity_colour(0.1) == SEVERITY[0] and severity_colour(7.0) == SEVERITY[2]
    assert part("leg left/1") == "leg_left_1"
    assert convergence.shown({}) == {}


def test_scenes_that_cannot_be(scene, raw):
    with pytest.raises(ClipError, match="no clip"):
        Scene("x", ())
    with pytest.raises(ClipError, match="two clips are called 'raw'"):
        Scene("x", (raw, raw))
    short = replace(scene.targets, positions=scene.targets.positions[:9], quaternions=scene.targets.quaternions[:9])
    with pytest.raises(ClipError, match="the targets have 9 frames, the clip 64"):
        Scene("x", (raw,), targets=short)


def test_a_clip_without_fault_opens_at_its_beginning(g1, raw, tmp_path):
    still = raw.motion.with_qpos(np.repeat(g1.nominal[None], 5, axis=0))
    clean = Scene("still", (track("still", still, g1, detect(still, g1)),))
    assert clean.worst() is None and clean.highlight is None and clean.opens_at == 0.0
    save(clean, tmp_path / "still.rrd", meshes=False)
    timelines = {name for chunk in RrdReader(tmp_path / "still.rrd").stream() for name in chunk.timeline_names}
    assert {"time", "frame"} <= timelines and "highlight" not in timelines


def test_only_this_machine_reaches_the_viewer(tmp_path):
    line = command(tmp_path / "x.rrd")
    assert line[line.index("--bind") + 1] == "127.0.0.1"
    assert int(line[line.index("--port") + 1]) > 0
    assert rr.__version__.startswith("0.41")
