"""n turbines of one linear model: their state, and the one step that changes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flapgym.core.arrays import BLADES, Array, FloatArray, IntArray
from flapgym.core.multiblade import to_blades, to_components
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.fingerprint import plant_fingerprint
from flapgym.plant.parameters import Episode, Loads, Parameters, State, Stepping, parameters_of, prepare
from flapgym.plant.responses import Responses, field_over_disk
from flapgym.plant.start import Start
from flapgym.plant.stuck import stuck_modes
from flapgym.plant.telling import tell
from flapgym.plant.upwind import known_ahead, measured_upwind
from flapgym.wind import Lidar
from flapgym.wind.blade_field import FieldOnDisk
from flapgym.wind.box_field import BoxOnDisk

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
        actuators = self.parameters.angle_limit.size
        _, stuck = stepping.faults.on(stepping.blades, len(model.flaps))
        self._held = np.zeros(actuators, dtype=bool)
        self._stuck = np.zeros(actuators)
        self._held[: stuck.size] = ~np.isnan(stuck)
        self._stuck[: stuck.size] = np.where(np.isnan(stuck), 0.0, stuck)
        self.state = State(
            elapsed=np.zeros(count, dtype=np.int64),
            flaps=np.zeros((4, actuators, count)),
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

    @property
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind in each turbine's episode, mean over the rotor, (n,) [m/s]."""
        return self._responses.strongest

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        p, kernel = self.parameters, self._kernel
        first = self._responses.draw(turbines, start)
        angle = np.where(self._held, self._stuck, start.angle)
        rate = np.where(self._held, 0.0, start.rate)
        stuck = (self._stuck * p.effectiveness)[: p.all_flaps].reshape(p.blades, p.flaps)
        modes = stuck_modes(kernel.flap, stuck, start.azimuth, kernel.turn)
        first = first + (modes @ kernel.flap.read.T).real
        acting = np.stack([angle, rate]) * p.effectiveness
        motion = _first_motion(acting, start.azimuth, p)
        first += motion @ kernel.direct[: motion.shape[1]]  # nothing accelerates yet
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

    def field(self, start: Start) -> FieldOnDisk | BoxOnDisk:
        """The wind over the disk while the one turbine of a start goes through its episode, for a picture.

        Raises
        ------
        ValueError
            If there is no field around this plant.
        """
        return field_over_disk(self._kernel.disturbance, start, self.stepping.intervals)

    @property
    def known_ahead(self) -> float:
        """Time beyond an episode up to which its wind can be told ahead [s]."""
        return known_ahead(self._kernel.disturbance, self.stepping.intervals)

    def upwind(self, lidar: Lidar, start: Start, arrival: Array) -> Array:
        """Speeds along a lidar's beams (m, S, N) [m/s], see `flapgym.plant.upwind.measured_upwind`."""
        return measured_upwind(self._kernel.disturbance, self.model, self.stepping, lidar, start, arrival)

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
        return self._kernel.steady.told(azimuth)

    def get_ready(self) -> None:
        """Take a step that leaves no trace: code is compiled or read now, and no later step waits for it."""
        still = np.zeros((self.count, self.parameters.angle_limit.size))
        self._step(self.parameters, self.episode, self.state, still)

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades A), finite fractions of what they command, for k plant steps."""
        self.state, loads = self._step(self.parameters, self.episode, self.state, actions)
        return loads

    @property
    def elapsed(self) -> IntArray:
        """Actions since each turbine's reset, (n,)."""
        return self.state.elapsed

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
        elapsed, flaps = self.state.elapsed.copy(), self.state.flaps.copy()
        modes = self.state.modes.copy()
        elapsed[turbine] = state["elapsed"]
        flaps[:3, :, turbine], flaps[3, :, turbine] = state["flaps"], state["travel"]
        modes[turbine] = state["modes"]
        self.state = State(elapsed, flaps, modes)


def _first_motion(acting: Array, azimuth: Array, parameters: Parameters) -> Array:
    """Angles and rates (2, m, blades A) in components, (m, 6 A): angles of actuators 1..A in 0, c, s, then rates."""
    p = parameters
    flaps = acting[..., : p.all_flaps].reshape(2, len(azimuth), p.blades, p.flaps)
    pitch = acting[..., p.all_flaps :].reshape(2, len(azimuth), p.blades, p.pitch)
    by_flap = np.concatenate([flaps, pitch], axis=3).transpose(1, 0, 3, 2)
    if p.blades == BLADES:
        components = to_components(by_flap, azimuth[:, None, None])
    else:
        components = np.pad(by_flap, ((0, 0), (0, 0), (0, 0), (0, BLADES - 1)))
    return components.reshape(len(azimuth), -1)
