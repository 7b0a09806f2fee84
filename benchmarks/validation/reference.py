"""What OpenFAST says: its time series, and figures of runs that are kept without one (tests/data/openfast)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flapgym.core.arrays import Array

FOLDER = Path(__file__).parents[2] / "tests" / "data" / "openfast"
WIND_SPEED = 11.0
"""Mean wind of all runs [m/s]; the rotor turns at a tip-speed ratio of 7."""


@dataclass(frozen=True, eq=False)
class Series:
    """Loads of one blade and the tower's top under a wind that is uniform over the disc.

    Attributes
    ----------
    time : (T,) float
        In even steps [s].
    wind : (T,) float
        At the hub, along the shaft [m/s].
    rbm, tip, tower : (T,) float
        Flapwise root bending moment of blade 1 [N m], its tip out of plane [m], the tower's top downwind [m].
    """

    time: Array
    wind: Array
    rbm: Array
    tip: Array
    tower: Array

    @property
    def time_step(self) -> float:
        """[s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def between(self, start: float, end: float = np.inf) -> Series:
        """The part from a time to another, both included [s]."""
        # Half a step of grace: times are sums of rounded steps.
        grace = 0.5 * self.time_step
        kept = (self.time > start - grace) & (self.time < end + grace)
        return Series(*(column[kept] for column in vars(self).values()))

    def at(self, time: Array) -> Series:
        """The same at other times, interpolated linearly."""
        columns = (self.wind, self.rbm, self.tip, self.tower)
        return Series(time, *(np.interp(time, self.time, column) for column in columns))


def read_series(name: str) -> Series:
    """One of OpenFAST's runs, such as "step_beamdyn_dynamic"; the folder's README lists them."""
    with np.load(FOLDER / "series.npz") as content:
        return Series(*(content[f"{name}.{key}"].astype(float) for key in Series.__dataclass_fields__))


@dataclass(frozen=True)
class Figures:
    """Single figures, by the program that gave them; SI units, flaps per degree.

    Attributes
    ----------
    thrust, torque, aerodynamic_moment : mapping
        Means of the rigid, undeflected rotor [N, N m], and of a blade's aerodynamic moment about its root [N m].
    root_reaction, tip, twist : mapping
        Means of the elastic blade: moment at the root [N m], tip out of plane [m], twist of the tip, nose up [rad].
    rigid_gain, rigid_early, rigid_peak, rigid_end : mapping
        Root moment per m/s of the rigid rotor [N m per m/s]: steady, and in a step after 0.2 s, at most, at the end.
    rigid_torque : mapping
        Torque of the rigid rotor per m/s [N m per m/s].
    rigid_flap, flap_moment, flap_tip : mapping
        Root moment of the rigid and of the elastic blade [N m per degree] and its tip [m per degree], all flaps alike.
    """

    thrust: Mapping[str, float]
    torque: Mapping[str, float]
    aerodynamic_moment: Mapping[str, float]
    root_reaction: Mapping[str, float]
    tip: Mapping[str, float]
    twist: Mapping[str, float]
    rigid_gain: Mapping[str, float]
    rigid_early: Mapping[str, float]
    rigid_peak: Mapping[str, float]
    rigid_end: Mapping[str, float]
    rigid_torque: Mapping[str, float]
    rigid_flap: Mapping[str, float]
    flap_moment: Mapping[str, float]
    flap_tip: Mapping[str, float]


def read_figures() -> Figures:
    """The figures of `figures.toml`."""
    return Figures(**tomllib.loads((FOLDER / "figures.toml").read_text(encoding="utf-8")))
