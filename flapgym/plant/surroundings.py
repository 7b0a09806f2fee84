"""What blows over the disk and pulls at the blades, turbulent field, inflow, gravity; the response to what is steady.

Superposition again: the response of an episode is computed at once. What is steady depends on the azimuth alone, and
its response is a few harmonics of three times the rotor's speed (harmonic balance). A field's is in
`flapgym.plant.field_response`, a box's in `flapgym.plant.box_response`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.constants import g as STANDARD_GRAVITY

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.multiblade import to_blades
from flapgym.core.state_space import StateSpace
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import COMPONENTS, grouped, strip_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Inflow
from flapgym.wind.box_field import BoxField
from flapgym.wind.turbulence import Turbulence

LEFT_OUT = 1e-10
"""Share of the steady wind's variance in each strip that harmonics may leave out. By default it is much more, as it is
of no account for the wind; but edgewise loads and the tower's acceleration are mostly of the highest harmonics."""


@dataclass(frozen=True)
class Surroundings:
    """Beside, or in place of, a homogeneous wind.

    Attributes
    ----------
    field : Turbulence, BoxField or None
        Which replaces the homogeneous turbulence; it knows its intensity and scale.
    inflow : Inflow or None
        What is steady of the wind over the disk.
    gravity : bool
        Whether the blades feel it.
    """

    field: Turbulence | BoxField | None = None
    inflow: Inflow | None = None
    gravity: bool = False

    @property
    def steady(self) -> bool:
        """Whether there is what depends on the azimuth alone."""
        return self.inflow is not None or self.gravity

    @property
    def turns(self) -> bool:
        """Whether it takes blades that turn."""
        return self.steady or self.field is not None

    def require(self, model: TurbineModel) -> None:
        """Refuse a model without the inputs that this takes (`require_inputs`)."""
        require_inputs(model, self.field is not None, self.inflow is not None, self.gravity)


def require_inputs(model: TurbineModel, field: bool, inflow: bool, gravity: bool) -> None:
    """Refuse a model without the inputs that a field, steady inflow or gravity take.

    Raises
    ------
    ValueError
        The message names the setting and a model that has them.
    """
    wants = [
        ("wind.field", field, "winds by strip", model.strips > 0),
        ("wind.inflow", inflow, "winds by strip", model.strips > 0),
        ("gravity", gravity, "gravity as an input", "gravity" in model.turbine.inputs),
    ]
    for name, wanted, what, there in wants:
        if not wanted:
            continue
        if not there:
            raise ValueError(
                f"{name}: expected a model with {what}, such as nrel5mw-site, got {model.name}; "
                "see [signals] in the case file"
            )
        if name != "gravity" and nameplate(model.case).disk is None:
            raise ValueError(f"{name}: expected a model whose case tells rotor and tower, got {model.name}")


@dataclass(frozen=True, eq=False)
class Steady:
    """The response to what is steady, about its mean over a revolution: that mean is a matter of the trim.

    Attributes
    ----------
    outputs : tuple of str
        Of the turbine, ny, the blades' in multi-blade coordinates.
    harmonics : (N + 1, ny + 1) complex
        Outputs in multi-blade coordinates, and the wind, are the real part of their sum times exp(i n `every` azimuth).
    mean : (ny + 1,) float
        What is left out: of the blades as components at azimuth zero, of the fixed outputs.
    every : int
        Of the rotor's harmonics, which there are: every third of equal blades, all of unequal ones.
    """

    outputs: tuple[str, ...]
    harmonics: ComplexArray
    mean: Array
    every: int = BLADES

    def at(self, azimuth: Array) -> Array:
        """Outputs and wind (T, ny + 1) at azimuths (T,) [rad]."""
        # Powers of one exponential: another exponential costs ten times a product.
        turns = np.vander(np.exp(1j * self.every * azimuth), len(self.harmonics), increasing=True)
        return np.asarray((turns @ self.harmonics).real)

    def told(self, azimuth: Array) -> dict[str, Array]:
        """Outputs by name at azimuths of blade 1 (T,) [rad]: the blades' (T, 3), the fixed ones (T,)."""
        found, told = self.at(azimuth), dict[str, Array]()
        for base, of_blades in grouped(self.outputs):
            at = self.outputs.index(f"{base}_{COMPONENTS[0]}" if of_blades else base)
            told[base] = to_blades(found[:, at : at + BLADES], azimuth) if of_blades else found[:, at]
        return told


def steady_response(model: TurbineModel, surroundings: Surroundings, outputs: tuple[str, ...]) -> Steady:
    """By harmonic balance: the turbine's frequency response at three, six, ... times the rotor's speed.

    Parameters
    ----------
    model : TurbineModel
    surroundings : Surroundings
    outputs : tuple of str
        Of the turbine; the wind is told behind them, and is zero.
    """
    forced = steady_inputs(model, surroundings)
    count = max(len(forcing) for _, forcing in forced)
    frequency = BLADES * np.arange(count) * model.rotor_speed / (2.0 * np.pi)
    harmonics = np.zeros((count, len(outputs) + 1), dtype=complex)
    for inputs, forcing in forced:
        part = model.turbine.select(inputs=inputs, outputs=list(outputs))
        response = part.frequency_response(frequency[: len(forcing)])
        harmonics[: len(forcing), :-1] += np.einsum("nyu,nu->ny", response, forcing)
    constant = [i for i, name in enumerate(outputs) if not name.endswith(("_c", "_s"))]
    mean = np.zeros(len(outputs) + 1)
    mean[constant] = harmonics[0, constant].real
    harmonics[0, constant] = 0.0
    return Steady(outputs, harmonics, mean)


def steady_inputs(model: TurbineModel, surroundings: Surroundings) -> list[tuple[list[str], ComplexArray]]:
    """What is steady: inputs of the turbine, and their harmonics (N, nu) of three times the rotor's speed."""
    forced: list[tuple[list[str], ComplexArray]] = []
    if surroundings.inflow is not None:
        disk = nameplate(model.case).disk
        assert disk is not None
        found = surroundings.inflow.components(strip_radii(model), disk, model.wind_speed, left_out=LEFT_OUT)
        forced.append((list(strip_inputs(model.strips)), found.reshape(len(found), -1)))
    if surroundings.gravity:
        forced.append((["gravity"], np.full((1, 1), STANDARD_GRAVITY, dtype=complex)))
    return forced


def strip_radii(model: TurbineModel) -> Array:
    """Middle of each strip along the blade, from the rotor's apex [m], (strips,)."""
    return nameplate(model.case).strip_radii


def strip_system(model: TurbineModel) -> StateSpace:
    """The turbine under winds by strip alone."""
    return model.turbine.select(inputs=list(strip_inputs(model.strips)))
