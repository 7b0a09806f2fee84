"""n turbines of one linear model: their state, and the one step that changes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flapgym.core.arrays import BLADES, Array, FloatArray, IntArray
from flapgym.core.multiblade import to_blades
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.backends.numpy import blade_transform, components
from flapgym.plant.kernel import prepare
from flapgym.plant.parameters import Episode, Loads, Parameters, State, Stepping
from flapgym.plant.plant import Plant
from flapgym.plant.responses import Responses
from flapgym.plant.start import Start
from flapgym.plant.stuck import stuck_modes
from flapgym.plant.telling import tell

Step = Callable[[Parameters, Episode, State, FloatArray], tuple[State, Loads]]


class LinearPlant(Plant):
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
    episode : Episode
    state : State
    """

    def __init__(self, model: TurbineModel, count: int, stepping: Stepping, step: Step) -> None:
        kernel = prepare(model, stepping)
        super().__init__(model, count, stepping, kernel, kernel.steady)
        self._step = step
        self._responses = Responses(kernel, count, stepping, model.turbulence_intensity)
        self.state = State(
            elapsed=np.zeros(count, dtype=np.int64),
            flaps=np.zeros((4, self._held.size, count)),
            modes=np.zeros((count, self.parameters.sizes.modes), dtype=stepping.precision),
        )
        self.episode = self._episode(np.zeros(count))

    def _episode(self, azimuth: Array) -> Episode:
        responses = self._responses
        return Episode(azimuth, responses.rows, responses.place, responses.level)

    @property
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind in each turbine's episode, mean over the rotor, (n,) [m/s]."""
        return self._responses.strongest

    @property
    def elapsed(self) -> IntArray:
        """Actions since each turbine's reset, (n,)."""
        return self.state.elapsed

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        p, kernel, flaps = self.parameters, self._kernel, self._flaps_at(start)
        s = p.sizes
        first = self._responses.draw(turbines, start)
        modes = stuck_modes(kernel.flap, self._stuck_angles(), start.azimuth, kernel.turn)
        first = first + (modes @ kernel.flap.C.T).real
        motion = components(p, flaps[:2], blade_transform(start.azimuth, s.blades))
        first += motion @ kernel.flap.D[:, : motion.shape[1]].T  # nothing accelerates yet
        self.state = self.state.copy()
        self.state.elapsed[turbines], self.state.flaps[:, :, turbines] = 0, flaps
        self.state.modes[turbines] = np.concatenate([modes.real, modes.imag], axis=1)
        azimuths = self.episode.azimuth.copy()
        azimuths[turbines] = start.azimuth
        self.episode = self._episode(azimuths)
        loads = BLADES * s.blade_outputs
        blades = first[:, :loads].reshape(-1, s.blade_outputs, 1, BLADES)
        blades = to_blades(blades, start.azimuth[:, None, None]) if s.blades == BLADES else blades[..., :1]
        return tell(
            p._replace(sizes=s._replace(record=0)),
            rbm=blades[:, 0],
            others=blades[:, 1:],
            fixed=first[:, loads:-1, None],
            wind=first[:, -1:],
            motion=flaps[None, :2],
            travel=flaps[3],
            stopped=np.zeros(flaps.shape[1:], dtype=bool),
            azimuth=start.azimuth,
        )

    def get_ready(self) -> None:
        """Take a step that leaves no trace: code is compiled or read now, and no later step waits for it."""
        still = np.zeros((self.count, self._held.size))
        self._step(self.parameters, self.episode, self.state, still)

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades A), finite fractions of what they command, for k plant steps."""
        self.state, loads = self._step(self.parameters, self.episode, self.state, actions)
        return loads

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""
        angle, rate = self.state.flaps[:2, : self.parameters.all_flaps]
        return angle.T, rate.T

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
        self.state = after = self.state.copy()
        after.elapsed[turbine], after.modes[turbine] = state["elapsed"], state["modes"]
        after.flaps[:3, :, turbine], after.flaps[3, :, turbine] = state["flaps"], state["travel"]
