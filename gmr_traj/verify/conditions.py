"""Under which conditions a rollout is made, read from ``configs/verify_*.toml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gmr_traj import resources
from gmr_traj.exceptions import ResourceError
from gmr_traj.toml_table import Table, read_toml

INTEGRATORS = ("euler", "implicitfast")


@dataclass(frozen=True)
class PlantSettings:
    """The simulation.

    Attributes:
        step: simulation step, which divides 20 ms [s].
        friction: of floor and robot [-].
        contact_time: time constant of contacts [s].
        integrator: one of ``INTEGRATORS``.
        self_collision: whether the robot's shapes collide with one another.
    """

    step: float
    friction: float
    contact_time: float
    integrator: str
    self_collision: bool


@dataclass(frozen=True)
class Randomisation:
    """What differs from trial to trial; uniform draws, the symmetric ones given by their half range.

    Attributes:
        friction: lowest and highest [-].
        mass: of all bodies [-].
        anchor_com: centre of mass of the anchor body [m].  # (3,)
        joint_offset: of every joint's zero position [rad].
        push_every: shortest and longest time between pushes [s].
        push_linear, push_angular: change of the base's velocity [m/s], [rad/s].  # (3,)
    """

    friction: tuple[float, float]
    mass: float
    anchor_com: np.ndarray
    joint_offset: float
    push_every: tuple[float, float]
    push_linear: np.ndarray
    push_angular: np.ndarray


@dataclass(frozen=True)
class Sensing:
    """What the controller is told instead of the state: half ranges of uniform noise, and the estimate.

    Attributes:
        position, orientation, linear_velocity, angular_velocity: of the base [m], [rad], [m/s], [rad/s].
        joint_position, joint_velocity: [rad], [rad/s].
        latency: control ticks by which a measurement is late.
        blend: share of the measurement in the estimate, (0, 1].
    """

    position: float
    orientation: float
    linear_velocity: float
    angular_velocity: float
    joint_position: float
    joint_velocity: float
    latency: int
    blend: float


@dataclass(frozen=True)
class Conditions:
    """One set of conditions.

    Attributes:
        name: e.g. ``sim``.
        sentence: what is special about it.
        plant: the simulation.
        randomise: what differs between trials; None for nothing.
        sensing: what stands between state and controller; None for nothing.
    """

    name: str
    sentence: str
    plant: PlantSettings
    randomise: Randomisation | None
    sensing: Sensing | None

    @property
    def random(self) -> bool:
        """Whether two trials differ."""
        return self.randomise is not None or self.sensing is not None


def load_conditions(name_or_path: str | Path) -> Conditions:
    """Conditions that ship with gmr-traj (``sim``, ``sim-dr``, ``sim2sim``), or those of a file.

    Raises:
        ResourceError: there are none of that name, or the file is wrong; the message says what.
    """
    shipped = f"verify_{str(name_or_path).replace('-', '_')}"
    known = shipped in resources.names("configs") and not Path(name_or_path).exists()
    table = read_toml(resources.find("configs", shipped if known else name_or_path), ResourceError)
    conditions = Conditions(
        name=table.text("name"),
        sentence=table.text("sentence"),
        plant=_plant(table.table("plant")),
        randomise=_randomise(table.table("randomise")) if "randomise" in table.values else None,
        sensing=_sensing(table.table("sensing")) if "sensing" in table.values else None,
    )
    for optional in ("randomise", "sensing"):
        table.get(optional, required=False)
    table.done()
    return conditions


def _plant(table: Table) -> PlantSettings:
    step, integrator = table.number("step", above=0.0), table.text("integrator")
    ticks = 0.02 / step
    if ticks < 1.0 - 1e-9 or abs(ticks - round(ticks)) > 1e-6:
        raise table.error(f"step is {step:g} s; it must divide the control tick of 0.02 s")
    if integrator not in INTEGRATORS:
        raise table.error(f"integrator is {integrator!r}; there are {', '.join(INTEGRATORS)}")
    friction, contact = table.number("friction", above=0.0), table.number("contact_time", above=0.0)
    settings = PlantSettings(step, friction, contact, integrator, table.flag("self_collision", True))
    table.done()
    return settings


def _randomise(table: Table) -> Randomisation:
    out = Randomisation(
        friction=_range(table, "friction"),
        mass=table.weight("mass"),
        anchor_com=table.point("anchor_com"),
        joint_offset=table.weight("joint_offset"),
        push_every=_range(table, "push_every"),
        push_linear=table.point("push_linear"),
        push_angular=table.point("push_angular"),
    )
    if out.mass >= 1.0:
        raise table.error(f"mass is {out.mass:g}; expected a share below 1")
    for key in ("anchor_com", "push_linear", "push_angular"):
        if (getattr(out, key) < 0.0).any():
            raise table.error(f"{key} is {getattr(out, key).tolist()}; half ranges are zero or more")
    table.done()
    return out


def _sensing(table: Table) -> Sensing:
    out = Sensing(
        position=table.weight("position"),
        orientation=table.weight("orientation"),
        linear_velocity=table.weight("linear_velocity"),
        angular_velocity=table.weight("angular_velocity"),
        joint_position=table.weight("joint_position"),
        joint_velocity=table.weight("joint_velocity"),
        latency=table.count("latency", 0),
        blend=table.number("blend", above=0.0),
    )
    if out.blend > 1.0:
        raise table.error(f"blend is {out.blend:g}; expected a share of at most 1")
    table.done()
    return out


def _range(table: Table, key: str) -> tuple[float, float]:
    value = table.get(key)
    good = isinstance(value, list) and len(value) == 2 and all(isinstance(x, int | float) for x in value)
    if not good or not 0.0 < value[0] <= value[1]:
        raise table.error(f"{key} is {value!r}; expected [lowest, highest], above zero")
    return float(value[0]), float(value[1])
