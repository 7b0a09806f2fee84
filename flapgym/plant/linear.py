"""n turbines of one linear model: their state, and the one step that changes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flapgym.core.arrays import BLADES, Array, FloatArray, IntArray
from flapgym.core.multiblade import to_blades, to_components
from flapgym.model.signals import COMPONENTS, grouped
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.fingerprint import plant_fingerprint
from flapgym.plant.parameters import Episode, Loads, Parameters, State, Stepping, parameters_of, prepare
from flapgym.plant.responses import Responses
from flapgym.plant.start import Start
from flapgym.plant.stuck import stuck_modes
from flapgym.plant.telling import tell

Step = Callable[[Parameters, Episode, State, FloatArray], tuple[State, Loads]]


class LinearPlant:
    """n turbines by superposition: the flaps' response is stepped, the wind's is read from a table.

    Parameters
    ----------
    model : TurbineModel
    count : int
        Number of turbines n.
    stepping : Stepping
    step : callable
        Of a module of `flapgym.plant.backends`: `step(parameters, episode, state, actions) -> state, loads`.

    Attributes
    ----------
    parameters : Parameters
    episode : Episode
    state : State
    """

    def __init__(self, model: TurbineModel, count: int, stepping: Stepping, step: Step) -> None:
        self.model, self.count, self.stepping = model, count, stepping
        self.quantities = stepping.quantities(model)
        self.fingerprint = plant_fingerprint(model)
        self._kernel, self._step = prepare(model, stepping), step
        self.parameters = parameters_of(model, stepping, self._kernel)
        self._responses = Responses(self._kernel, count, stepping, model.turbulence_intensity)
        flaps = self.parameters.angle_limit.size
        _, stuck = stepping.faults.on(stepping.blades, len(model.flaps))
        self._stuck = np.where(np.isnan(stuck), 0.0, stuck)
        self._held = ~np.isnan(stuck)
        self.state = State(
            elapsed=np.zeros(count, dtype=np.int64),
            flaps=np.zeros((4, flaps, count)),
            modes=np.zeros((count, 2 * self._kernel.flap.order), dtype=stepping.precision),
        )
        self.episode = Episode(
            azimuth=np.zeros(count),
            responses=self._responses.rows,
            place=self._responses.place,
            level=self._responses.level,
        )

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self._kernel.disturbance.noise_count(self.stepping.intervals)

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        p, kernel = self.parameters, self._kernel
        first = self._responses.draw(turbines, start)
        angle = np.where(self._held, self._stuck, start.flap_angle)
        rate = np.where(self._held, 0.0, start.flap_rate)
        modes = stuck_modes(kernel.flap, self._stuck * p.effectiveness, start.azimuth, kernel.turn)
        first = first + (modes @ kernel.flap.read.T).real
        acting = np.stack([angle, rate]) * p.effectiveness
        first += _first_motion(acting, start.azimuth, p.blades, p.flaps) @ kernel.direct
        flaps = np.zeros((4, angle.shape[1], len(turbines)))
        flaps[0], flaps[1] = angle.T, rate.T
        self._place(turbines, start.azimuth, flaps, np.concatenate([modes.real, modes.imag], axis=1))
        loads = BLADES * p.blade_outputs
        blades = first[:, :loads].reshape(-1, p.blade_outputs, 1, BLADES)
        azimuth = start.azimuth[:, None, None]
        blades = to_blades(blades, azimuth) if p.blades == BLADES else blades[..., :1]
        return tell(
            p._replace(record=False),
            rbm=blades[:, 0],
            others=blades[:, 1:],
            fixed=first[:, loads:-1, None],
            wind=first[:, -1:],
            motion=flaps[None, :2],
            travel=flaps[3],
            stopped=np.zeros(flaps.shape[1:], dtype=bool),
            azimuth=start.azimuth,
        )

    def _place(self, turbines: IntArray, azimuth: Array, flaps: Array, modes: Array) -> None:
        """Put m turbines in place of those that were there."""
        elapsed, all_flaps = self.state.elapsed.copy(), self.state.flaps.copy()
        all_modes = self.state.modes.copy()
        elapsed[turbines], all_flaps[:, :, turbines], all_modes[turbines] = 0, flaps, modes
        azimuths = self.episode.azimuth.copy()
        azimuths[turbines] = azimuth
        self.state = State(elapsed, all_flaps, all_modes)
        responses = self._responses
        self.episode = Episode(azimuths, responses.rows, responses.place, responses.level)

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """What steady inflow and gravity do to the outputs at azimuths of blade 1 (n,) [rad], about its mean.

        Of the blades' outputs (n, blades), of the fixed ones (n,).

        Raises
        ------
        ValueError
            If nothing is steady around this plant.
        """
        if self._kernel.steady is None:
            raise ValueError("steady: expected steady inflow or gravity around the plant, there is none")
        found, names = self._kernel.steady.at(azimuth), self._kernel.flap.outputs
        told: dict[str, Array] = {}
        for base, of_blades in grouped(names[:-1]):
            at = names.index(f"{base}_{COMPONENTS[0]}" if of_blades else base)
            told[base] = to_blades(found[:, at : at + BLADES], azimuth) if of_blades else found[:, at]
        return told

    def get_ready(self) -> None:
        """Take a step that leaves no trace: code is compiled or read now, and no later step waits for it."""
        still = np.zeros((self.count, self.parameters.angle_limit.size))
        self._step(self.parameters, self.episode, self.state, still)

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades F), finite fractions of the acceleration limits, for k plant steps."""
        self.state, loads = self._step(self.parameters, self.episode, self.state, actions)
        return loads

    @property
    def elapsed(self) -> IntArray:
        """Actions since each turbine's reset, (n,)."""
        return self.state.elapsed

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""
        return self.state.flaps[0].T, self.state.flaps[1].T

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        return {
            "elapsed": int(self.state.elapsed[turbine]),
            "flaps": self.state.flaps[:3, :, turbine].tolist(),
            "travel": self.state.flaps[3, :, turbine].tolist(),
            "modes": self.state.modes[turbine].astype(float).tolist(),
        }

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        elapsed, flaps = self.state.elapsed.copy(), self.state.flaps.copy()
        modes = self.state.modes.copy()
        elapsed[turbine] = state["elapsed"]
        flaps[:3, :, turbine], flaps[3, :, turbine] = state["flaps"], state["travel"]
        modes[turbine] = state["modes"]
        self.state = State(elapsed, flaps, modes)


def _first_motion(acting: Array, azimuth: Array, blades: int, flaps: int) -> Array:
    """Flap angles and rates (2, m, blades F) in components, (m, 6 F): angles of flaps 1..F in 0, c, s, then rates."""
    by_flap = acting.reshape(2, -1, blades, flaps).transpose(1, 0, 3, 2)
    if blades == BLADES:
        components = to_components(by_flap, azimuth[:, None, None])
    else:
        components = np.pad(by_flap, ((0, 0), (0, 0), (0, 0), (0, BLADES - 1)))
    return components.reshape(len(azimuth), -1)
