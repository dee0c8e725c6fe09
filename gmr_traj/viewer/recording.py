"""Writing a scene to an .rrd file."""

from __future__ import annotations

import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from gmr_traj.exceptions import GmrTrajError
from gmr_traj.link_meshes import link_meshes
from gmr_traj.viewer import (
    artefact_lanes,
    contact_forces,
    convergence,
    documents,
    motion_columns,
    people,
    robot_geometry,
    signal_columns,
    stances,
)
from gmr_traj.viewer.blueprint import blueprint, document_titles
from gmr_traj.viewer.scene import Scene
from gmr_traj.viewer.timelines import Clock

if TYPE_CHECKING:
    import rerun as rr

APPLICATION = "gmr-traj"


def save(scene: Scene, path: str | Path, *, meshes: bool = True) -> None:
    """Write a scene as a recording, whole or not at all.

    Args:
        scene: what to show.
        path: the .rrd file.
        meshes: whether to take the meshes of the links along where a package provides them; they are most of the file.

    Raises:
        GmrTrajError: the file cannot be written.
    """
    import rerun as rr

    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise GmrTrajError(f"{path}: cannot write: there is no folder {target.parent}")
    clock = Clock(scene.fps, scene.highlight)
    staged = target.with_name(f".{target.stem}.{secrets.token_hex(6)}.rrd")
    try:
        with rr.RecordingStream(APPLICATION, recording_id=scene.title) as stream:
            found = {track.name: link_meshes(track.robot) if meshes else () for track in scene.tracks}
            stream.save(staged, default_blueprint=blueprint(scene, any(found.values())))
            stream.send_recording_name(scene.title)
            stream.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for place, track in enumerate(scene.tracks):
                # The first of several is what the others are held against: seen through.
                opacity = robot_geometry.TRANSLUCENT if place == 0 and len(scene.tracks) > 1 else 1.0
                colour = scene.colour(track)
                motion_columns.log(stream, track, clock)
                robot_geometry.log_shapes(stream, track, colour, opacity)
                robot_geometry.log_meshes(stream, track, found[track.name], colour, opacity)
                stances.log_points(stream, track, clock)
                stances.log_anchors(stream, track, clock)
                artefact_lanes.log(stream, track, clock)
                if track.forces is not None:
                    contact_forces.log(stream, track, track.forces, clock)
            stances.log_lanes(stream, scene.tracks[-1], clock)
            signal_columns.log(stream, scene, clock)
            convergence.log(stream, scene.trace)
            if scene.human is not None:
                people.log_human(stream, scene.human, clock)
            if scene.targets is not None:
                people.log_targets(stream, scene.targets, scene.tracks[0].time, clock)
            _log_texts(stream, scene)
            stream.flush()
            stream.disconnect()
        os.replace(staged, target)
    finally:
        staged.unlink(missing_ok=True)


def _log_texts(stream: rr.RecordingStream, scene: Scene) -> None:
    import rerun as rr

    texts = {
        "guide": documents.guide(scene),
        "worst": "\n\n".join(documents.worst_artefacts(track) for track in scene.tracks),
    }
    if scene.certificate is not None:
        texts["certificate"] = documents.certificate(scene.certificate)
    for name in document_titles(scene):
        stream.log(f"/text/{name}", rr.TextDocument(texts[name], media_type=rr.MediaType.MARKDOWN), static=True)
