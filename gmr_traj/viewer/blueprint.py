"""The layout of a recording: robots on the left, plots on the right, lanes below; it opens at the worst artefact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gmr_traj.human_motion import HumanMotion
from gmr_traj.track import Track
from gmr_traj.viewer import convergence, people, timelines
from gmr_traj.viewer.motion_columns import base_path
from gmr_traj.viewer.paths import part
from gmr_traj.viewer.robot_geometry import shapes_path
from gmr_traj.viewer.scene import Scene

if TYPE_CHECKING:
    import rerun.blueprint as rrb

AROUND = 1.5  # what plots and lanes show on either side of the cursor [s]
EYE = np.array([1.75, -1.6, 0.45])  # from the robot's base to the eye [m]
SPEED = 0.25  # of what the recording opens with
BACKGROUND, GRID = (24, 27, 32), (150, 156, 164, 110)


def blueprint(scene: Scene, meshes: bool) -> rrb.Blueprint:
    """Lay a scene out.

    Args:
        scene: what is shown.
        meshes: whether link meshes were logged; the collision shapes are hidden then, and can be shown.
    """
    import rerun.blueprint as rrb

    alone = [_robots(scene, f"{track.name} alone", (track,), meshes) for track in scene.tracks]
    if scene.human is not None:
        alone.insert(0, _person(scene, scene.human))
    spatial: list[rrb.View | rrb.Container] = [rrb.Horizontal(*alone)]
    if len(scene.tracks) > 1:
        name = ", ".join(track.name for track in scene.tracks) + " in one place"
        spatial.insert(0, _robots(scene, name, scene.tracks, meshes))
    lanes = [rrb.StateTimelineView(origin="/artefacts", name="Artefacts", time_view=_axis())]
    lanes += [rrb.StateTimelineView(origin="/stances", name=f"Stances of {scene.tracks[-1].name}", time_view=_axis())]
    looped = scene.highlight is not None
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*spatial, _texts(scene), row_shares=[5, 3, 4][-len(spatial) - 1 :]),
            rrb.Vertical(_plots(scene), *lanes, row_shares=[5.0, 2.9, 2.15]),
            column_shares=[4, 5],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=timelines.HIGHLIGHT if looped else timelines.TIME,
            play_state="playing" if looped else "paused",
            loop_mode="all" if looped else "off",
            playback_speed=SPEED if looped else 1.0,
            fps=scene.fps,
        ),
    )


def document_titles(scene: Scene) -> dict[str, str]:
    """The texts of a recording, by entity name, with their titles, in order."""
    titles = {"guide": "Start here", "worst": "All artefacts, worst first"}
    if scene.certificate is not None:
        titles["certificate"] = "Certificate"
    return titles


def _robots(scene: Scene, name: str, tracks: tuple[Track, ...], meshes: bool) -> rrb.Spatial3DView:
    """A view of some of the robots, the eye on the first where the recording opens."""
    import rerun.blueprint as rrb

    first = tracks[0]
    base = first.motion.qpos[first.frame(scene.opens_at), :3]
    shown = [f"/world/{part(track.name)}" for track in tracks]
    if scene.targets is not None and len(tracks) == len(scene.tracks):
        shown.append(people.TARGETS)
    view = _spatial(name, shown, base, base_path(first))
    if meshes:
        view.visualizer_overrides = {shapes_path(track): rrb.EntityBehavior(visible=False) for track in tracks}
    return view


def _person(scene: Scene, human: HumanMotion) -> rrb.Spatial3DView:
    """A view of the person the motion came from."""
    frame = min(human.frames - 1, round(scene.opens_at * human.fps))
    return _spatial("source", [people.HUMAN], human.positions[frame, 0], f"{people.HUMAN}/joints")


def _spatial(name: str, shown: list[str], centre: np.ndarray, follow: str) -> rrb.Spatial3DView:
    """A view in space whose eye looks at a point, goes with an entity, and can be moved."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin="/world",
        contents=[f"+ {path}/**" for path in shown],
        name=name,
        background=list(BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=list(GRID)),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=centre + EYE,
            look_target=centre - [0.0, 0.0, 0.12],
            eye_up=(0.0, 0.0, 1.0),
            tracking_entity=follow,
        ),
    )


def _plots(scene: Scene) -> rrb.Grid:
    """All signals, and the speed of the worst artefact's joint beside its limit; the first plot has the legend."""
    import rerun.blueprint as rrb

    joint = _joint(scene)
    plots = {f"/signals/{s.name}": f"{s.title} [{s.unit}]" for s in scene.tracks[0].signals}
    plots |= {f"/joints/{part(joint)}/velocity": f"{joint}: speed and limit [rad/s]"}
    views = [
        rrb.TimeSeriesView(
            origin=origin,
            name=title,
            axis_x=_axis(),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=place == 0),
        )
        for place, (origin, title) in enumerate(plots.items())
    ]
    return rrb.Grid(*views, grid_columns=2)


def _texts(scene: Scene) -> rrb.Tabs:
    import rerun.blueprint as rrb

    texts: list[rrb.View | rrb.Container] = [
        rrb.TextDocumentView(origin=f"/text/{name}", name=title) for name, title in document_titles(scene).items()
    ]
    bars = [
        rrb.BarChartView(origin=f"/solver/{key}", name=title) for key, title in convergence.shown(scene.trace).items()
    ]
    if bars:
        texts.append(rrb.Vertical(*bars, name="Ipopt"))
    return rrb.Tabs(*texts, active_tab=0)


def _axis() -> rrb.archetypes.TimeAxis:
    """The stretch of time around the cursor."""
    import rerun as rr
    import rerun.blueprint as rrb

    start, end = (rr.TimeRangeBoundary.cursor_relative(seconds=side * AROUND) for side in (-1, 1))
    return rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))


def _joint(scene: Scene) -> str:
    """The joint to show beside its limits: that of the worst artefact that has one, else the first."""
    names = scene.tracks[0].robot.joint_names
    worst = scene.worst()
    if worst is not None and worst.where in names:
        return worst.where
    return next((a.where for a in scene.tracks[0].artefacts if a.where in names), names[0])
