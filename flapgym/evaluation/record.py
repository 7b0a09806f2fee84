"""Recorded series of one or more realisations, and the same as labelled data with units."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES

if TYPE_CHECKING:
    import xarray

UNITS = {
    r"rbm(_\w+)?|\w*moment(_\d+)?|tower_base_\w+|\w*torque|root_torsion": "N m",
    r"\w*thrust": "N",
    r"(tip_)?deflection(_\d+)?|tip_in_plane": "m",
    r"\w*acceleration_\w+": "m/s^2",
}
"""Of a channel, by what its name matches."""
OPERATION = {"rotor_speed": "rad/s", "collective_pitch": "rad", "wind_speed_estimate": "m/s"}
"""Further outputs of a model with a loop for the rotor's speed that load nothing, with their units."""

_BLADE, _FLAP, _FIXED = (
    ("realisation", "time", "blade"),
    ("realisation", "time", "blade", "flap"),
    ("realisation", "time"),
)
_SERIES = {
    "rbm": (_BLADE, "N m", "flapwise root bending moment"),
    "tip_deflection": (_BLADE, "m", "tip deflection, out of plane"),
    "flap_angle": (_FLAP, "rad", "flap angle"),
    "flap_rate": (_FLAP, "rad/s", "flap rate"),
    "pitch_angle": (_BLADE, "rad", "blade pitch from the operating point's"),
    "tower_fore_aft": (_FIXED, "m", "tower-top displacement downwind"),
    "tower_side_side": (_FIXED, "m", "tower-top displacement sideways"),
    "wind": (_FIXED, "m/s", "wind perturbation along the shaft"),
}
"""Dimensions, unit and meaning of each series of a record."""


@dataclass(frozen=True, eq=False)
class Record:
    """Every plant sample of one or more realisations, leading axis the realisation, blades last.

    Attributes
    ----------
    rbm, tip_deflection : (N, T, 3) float
        Flapwise root bending moment [N m] and tip deflection [m].
    flap_angle, flap_rate : (N, T, 3 F) float
        Flap motion after its stops [rad, rad/s], of F flaps a blade blade by blade.
    tower_fore_aft, tower_side_side, wind : (N, T) float
        Tower-top displacement downwind and sideways [m], wind perturbation [m/s].
    pitch_angle : (N, T, 3) float
        From the operating point's [rad]; (N, T, 0) where pitch stays.
    azimuth : (N,) float
        Of blade 1 one time step before the first sample [rad].
    time_step : float
        Sampling time [s].
    further : mapping of str to (N, T, 3) or (N, T) float
        Further outputs of the model by name, the blades' with three columns, in SI units.
    """

    rbm: NDArray[np.float64]
    tip_deflection: NDArray[np.float64]
    flap_angle: NDArray[np.float64]
    flap_rate: NDArray[np.float64]
    tower_fore_aft: NDArray[np.float64]
    tower_side_side: NDArray[np.float64]
    wind: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    time_step: float
    further: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    pitch_angle: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0, 0)))

    def to_xarray(self, seeds: Sequence[int] | None = None) -> xarray.Dataset:
        """The series as a `Dataset` with dimensions realisation, time, blade and, of flap motion, flap.

        Units stand in attributes. Time is that of each sample since the episode's start [s]; blades and flaps are
        counted from 1, flaps from root to tip.

        Parameters
        ----------
        seeds : sequence of int, optional
            Of the realisations, as their coordinate; by default they are counted from 0.

        Raises
        ------
        ImportError
            If xarray is not installed.
        ValueError
            If there is not one seed a realisation.
        """
        require_xarray("to_xarray")
        import xarray  # long to import, and an extra

        count, samples = self.wind.shape
        labels = range(count) if seeds is None else seeds
        if len(labels) != count:
            raise ValueError(f"to_xarray.seeds: expected {count}, one a realisation, got {len(labels)}")
        found: dict[str, Any] = {}
        for name, (dimensions, unit, meaning) in _SERIES.items():
            values = getattr(self, name)
            if not values.size:  # pitch that stays
                continue
            if dimensions == _FLAP:
                values = values.reshape(count, samples, BLADES, -1)
            found[name] = (dimensions, values, {"units": unit, "long_name": meaning})
        for name, values in self.further.items():
            unit = unit_of(name)
            found[name] = (_BLADE if values.ndim == 3 else _FIXED, values, {"units": unit} if unit else {})
        meaning = "of blade 1, one time step before the first sample; zero where it points up"
        found["azimuth"] = ("realisation", self.azimuth, {"units": "rad", "long_name": meaning})
        coordinates: dict[str, Any] = {
            "realisation": (
                "realisation",
                np.array(labels),
                {"long_name": "number" if seeds is None else "seed"},
            ),
            "time": ("time", self.time_step * np.arange(1, samples + 1), {"units": "s"}),
            "blade": np.arange(1, BLADES + 1),
            "flap": np.arange(1, found["flap_angle"][1].shape[-1] + 1),
        }
        return xarray.Dataset(found, coordinates)


def joined_records(records: Sequence[Record]) -> Record:
    """One record of all realisations, of records that differ in these alone."""
    return _made_of(records, np.concatenate)


def first_realisation(record: Record) -> Record:
    """The first realisation alone, in arrays of its own: a view would keep the others alive."""
    return _made_of([record], lambda arrays: arrays[0][:1].copy())


def _made_of(
    records: Sequence[Record], made: Callable[[Sequence[NDArray[np.float64]]], NDArray[np.float64]]
) -> Record:
    """A record each of whose arrays is made of those of others."""
    names = [each.name for each in fields(Record) if each.name not in ("time_step", "further")]
    first = records[0]
    return Record(
        **{name: made([getattr(each, name) for each in records]) for name in names},
        time_step=first.time_step,
        further={name: made([each.further[name] for each in records]) for name in first.further},
    )


def require_xarray(field: str) -> None:
    """Refuse, naming the field, what needs xarray where it is not installed."""
    if importlib.util.find_spec("xarray") is None:
        raise ImportError(f"{field}: xarray is not installed (pip install 'flapgym[series]')")


def unit_of(channel: str) -> str:
    """SI unit of a channel by its name; empty if the name tells none."""
    return OPERATION.get(channel) or next(
        (unit for pattern, unit in UNITS.items() if re.fullmatch(pattern, channel)), ""
    )
