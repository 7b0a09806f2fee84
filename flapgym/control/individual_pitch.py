"""Individual pitch control as the wind industry has it: an integral of tilt and yaw, beside an agent of the flaps.

What comes twice a turn can have an integral of its own, of the components at twice the azimuth. With M_c and M_s those
at the azimuth psi itself, M_2c + i M_2s = exp(3 i psi) (M_c - i M_s): twice a turn on the blades is the cyclic pattern
that whirls backward, at three times the rotor's speed in the fixed frame. So the model in multi-blade coordinates knows
it already, and the loop of both integrals is time-invariant there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from flapgym.control.agent import OBSERVATION_SCALES, OF_FLAPS, Agent, Floats, OpenLoop, blade_entries
from flapgym.control.margins import DiskMargin
from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.fields import Quantity
from flapgym.core.multiblade import to_blades, to_components
from flapgym.model.signals import PITCH_KINDS
from flapgym.model.turbine_model import TurbineModel
from flapgym.turbine import Pitch

INDIVIDUAL_PITCH = "individual_pitch"
"""What it is called where agents go by names."""
CROSSOVER = 0.3
"""Of its integral there [rad/s]. A faster one takes off little more, 0.5 two points of the site's DEL at 11 m/s."""
INDIVIDUAL_PITCH_2P = "individual_pitch_2p"
"""With an integral of what comes twice a turn."""
SECOND_CROSSOVER = 0.2
"""Of its integral there [rad/s]: the fastest that leaves the margin, at 11 m/s, to the integral once a turn."""
OBSERVED = ("rbm", "azimuth")
NOT_OF_BLADES = {"azimuth": 2, "tower_top": 2, "wind": 1}
"""Entries of observations that blades do not have each."""
STATES = 3
"""Of each component: two delays of the filter, and the integral."""
FREQUENCIES = np.geomspace(1e-3, 2.0, 400)
"""Of the fixed frame [Hz], at which the margin is looked for."""
BESIDE = np.geomspace(1e-4, 0.2, 200)
"""Further ones, to either side of three times the rotor's speed, where the integral twice a turn stands [Hz]."""
_WHIRLS = np.array([[1.0, -1.0j], [1.0, 1.0j]])
"""Components x_c and x_s are to a blade x_c -+ i x_s, at the frequency turned on and back by the rotor's."""
NOTCH_QUALITY = 1.0
"""Of the notch at the blade passing frequency: its centre over its width at -3 dB."""


@dataclass(frozen=True, eq=False)
class IndividualPitch:
    """Pitch demands from the integrals of the tilting and the yawing component of the root moments.

    So for each multiple of the azimuth, one, or one and two. The components pass a notch at three times the rotor's
    speed. There moments twice and four times a turn come to in those at the azimuth, moments once and five times a turn
    in those at twice the azimuth: neither integral sees what is the other's. The integrals do not grow beyond the stop.

    Parameters
    ----------
    name : str
        What tables call it.
    gain : (H, 2, 2) float
        Cosine and sine component of the demand at multiples 1 to H of the azimuth, H = 1 or 2, per integral of those of
        the moment [rad / (N m s)].
    notch : (2, 3) float
        Numerator and denominator of the filter, in powers of the delay by one action.
    leak : float
        Share of the integral that an action leaves.
    lead : float
        Azimuth [rad] by which the rotor turns until the middle of an action.
    limit : float
        Stop of pitch [rad], the demand of an action of one.
    interval : float
        For which an action is held [s].
    steps_per_action : int
        The same in plant steps.
    beside : Agent
        What moves the flaps; by default they rest.
    model_hash : str or None
        Hash of the model it was designed on.
    """

    name: str
    gain: Array
    notch: Array
    leak: float
    lead: float
    limit: float
    interval: float
    steps_per_action: int
    beside: Agent = field(default_factory=OpenLoop)
    model_hash: str | None = None
    pitches = True
    """It gives three more actions than the flaps have."""

    @property
    def time_step(self) -> float:
        """Of the plants it was made for [s]."""
        return self.interval / self.steps_per_action

    @property
    def observe(self) -> tuple[str, ...]:
        """What the agent of the flaps observes, then what is not among that."""
        return (*self.beside.observe, *(name for name in OBSERVED if name not in self.beside.observe))

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3 F + 3) and next state (..., n) for an observation."""
        values = np.asarray(observation)
        multiples, size = range(1, len(self.gain) + 1), 2 * STATES * len(self.gain)
        places, batch = self._places(values.shape[-1]), values.shape[:-1]
        begins = np.full(batch, state is None)
        if state is None:
            state = np.zeros((*batch, size))
        elif episode_start is not None:
            begins = np.broadcast_to(np.reshape(episode_start, batch), batch)
        # The flaps' agent may keep a row a blade: this one's state then stands before each of them.
        own = state[..., :size].reshape(*batch, -1, size)[..., 0, :]
        delays = np.where(begins[..., None], 0.0, own).reshape(*batch, len(multiples), STATES, 2)
        of_flaps, after_flaps = self.beside.predict(
            values[..., : places["flaps"].stop],
            state[..., size:] if state.shape[-1] > size else None,
            episode_start,
            deterministic,
        )
        azimuth = np.arctan2(values[..., places["azimuth"].start + 1], values[..., places["azimuth"].start])
        moments, azimuth = values[..., places["rbm"]].astype(float), azimuth.astype(float)
        moments *= OBSERVATION_SCALES["rbm"]
        seen = np.stack(
            [to_components(moments, azimuth, multiple)[..., 1:] for multiple in multiples], axis=-2
        )
        # The filter in its transposed direct form: two delays of each component, then the integral.
        numerator, denominator = self.notch
        filtered = numerator[0] * seen + delays[..., 0, :]
        after = np.empty_like(delays)
        after[..., 0, :] = numerator[1] * seen - denominator[1] * filtered + delays[..., 1, :]
        after[..., 1, :] = numerator[2] * seen - denominator[2] * filtered
        integral = self.leak * delays[..., 2, :] + self.interval * filtered
        demand = np.einsum("hij,...hj->...hi", self.gain, integral)
        # The sum of the amplitudes, not a component, meets the stop: no azimuth is special.
        amplitude = np.linalg.norm(demand, axis=-1).sum(axis=-1)
        within = np.minimum(1.0, self.limit / np.maximum(amplitude, np.finfo(float).tiny))[..., None, None]
        after[..., 2, :] = integral * within
        cyclic = np.concatenate([np.zeros((*batch, len(multiples), 1)), demand * within], axis=-1)
        asked = sum(
            to_blades(cyclic[..., multiple - 1, :], azimuth + self.lead, multiple) for multiple in multiples
        )
        pitch = np.clip(asked / self.limit, -1.0, 1.0)
        action = np.concatenate([of_flaps, pitch.astype(np.float32)], axis=-1)
        after = after.reshape(*batch, size)
        if after_flaps is None:
            return action, after
        rows = after_flaps.shape[len(batch) : -1]
        after = np.broadcast_to(after.reshape(*batch, *(1 for _ in rows), size), (*batch, *rows, size))
        return action, np.concatenate([after, after_flaps], axis=-1)

    def _places(self, size: int) -> dict[str, slice]:
        """Where things stand in an observation of so many entries."""
        of_flaps = sum(name in OF_FLAPS for name in self.observe)
        others = sum(NOT_OF_BLADES.get(name, BLADES) for name in self.observe if name not in OF_FLAPS)
        flaps = (size - others) // (BLADES * of_flaps) if of_flaps else 1
        found, first = {}, 0
        for name in self.observe:
            wide = NOT_OF_BLADES.get(name, BLADES * blade_entries((name,), flaps))
            found[name] = slice(first, first + wide)
            first += wide
        if size != first:
            raise ValueError(
                f"agent {self.name}: expected {first} observations ({', '.join(self.observe)}), got {size}"
            )
        found["flaps"] = slice(0, found[self.beside.observe[-1]].stop)
        return found


def individual_pitch_agent(
    name: str,
    model: TurbineModel,
    crossover: float,
    flaps: Agent | None = None,
    forgetting: float = 200.0,
    second: float = 0.0,
) -> IndividualPitch:
    """Individual pitch control by the effect of steady demands, at the azimuth and at twice it, on the model's turbine.

    Parameters
    ----------
    name : str
    model : TurbineModel
        With pitch as an input.
    crossover : float
        Of the integral in tilt and yaw [rad/s].
    flaps : Agent, optional
        What moves the flaps, whose actions are held as long; by default they rest.
    forgetting : float
        Time in which the integral forgets [s].
    second : float
        Crossover of the integral at twice the azimuth [rad/s]; at zero there is none.

    Raises
    ------
    ValueError
        If the model has no such input.
    """
    Quantity("angular rate", above=0.0).check(crossover, "individual_pitch.crossover")
    Quantity("time", above=0.0).check(forgetting, "individual_pitch.forgetting")
    Quantity("angular rate", at_least=0.0).check(second, "individual_pitch.second")
    if model.pitch_actuator is None:
        raise ValueError(
            f"individual_pitch: expected a model with pitch as an input, such as nrel5mw-site, got {model.name}"
        )
    flaps = OpenLoop() if flaps is None else flaps
    steps = 5 if isinstance(flaps, OpenLoop) else flaps.steps_per_action
    interval = steps * model.time_step
    gain = [-crossover * np.linalg.inv(cyclic_gain(model, model.pitch_actuator))]
    if second > 0.0:
        factor = -second / second_gain(model, model.pitch_actuator)
        gain.append(np.array([[factor.real, -factor.imag], [factor.imag, factor.real]]))
    return IndividualPitch(
        name,
        gain=np.stack(gain),
        notch=np.array(scipy.signal.iirnotch(_passing(model), NOTCH_QUALITY, 1.0 / interval)),
        leak=float(np.exp(-interval / forgetting)),
        lead=0.5 * interval * model.rotor_speed,
        limit=model.pitch_actuator.angle_limit,
        interval=interval,
        steps_per_action=steps,
        beside=flaps,
        model_hash=model.hash,
    )


def _passing(model: TurbineModel) -> float:
    """Frequency at which blades pass the tower [Hz]."""
    return float(BLADES * model.rotor_speed / (2.0 * np.pi))


def cyclic_gain(model: TurbineModel, actuator: Pitch) -> Array:
    """Cosine and sine component of the root moments per steady one of the demands, (2, 2) [N m / rad].

    Each blade's actuator meets a demand at the rotor's frequency, which it follows late.
    """
    return np.asarray(cyclic_response(model, actuator, np.zeros(1))[0].real)


def second_gain(model: TurbineModel, actuator: Pitch) -> complex:
    """Moment M_2c + i M_2s per steady demand of it at twice the azimuth [N m / rad], its turn the argument.

    Each blade's actuator meets the demand at twice the rotor's frequency.
    """
    (response,) = cyclic_response(model, actuator, np.array([_passing(model)]))
    whirling = _WHIRLS @ response @ np.linalg.inv(_WHIRLS)
    return complex(np.conj(whirling[1, 1]))


def cyclic_response(model: TurbineModel, actuator: Pitch, frequency: Array) -> ComplexArray:
    """The same at frequencies (F,) [Hz] of the fixed frame, (F, 2, 2)."""
    w, turn = 2.0 * np.pi * actuator.natural_frequency, model.rotor_speed
    met = 2.0 * np.pi * frequency[:, None] + np.array([turn, -turn])
    follows = w**2 / (w**2 - met**2 + 2j * actuator.damping * w * met)
    together = np.linalg.inv(_WHIRLS)
    # Angle, rate and acceleration of each blade.
    kinds = (np.ones_like(met), 1j * met, -(met**2))
    inputs = np.concatenate(
        [np.einsum("ab,fb,bc->fac", together, follows * kind, _WHIRLS) for kind in kinds], axis=1
    )
    names = [f"pitch_{kind}_{part}" for kind in PITCH_KINDS for part in "cs"]
    turbine = model.turbine.select(names, ["rbm_c", "rbm_s"]).frequency_response(frequency)
    return np.asarray(turbine @ inputs)


def pitch_margin(model: TurbineModel, agent: IndividualPitch) -> DiskMargin:
    """Disk margin at the tilting and the yawing component of the measured moments together; the flaps at rest.

    As `flapgym.control.margins.disk_margin`, over `FREQUENCIES`, of all integrals together, so not above that of any
    of them. The loop is stable if this is above zero and the integrals slow: no gain below one of the margin's can have
    been passed on the way from none.

    Raises
    ------
    ValueError
        If the model has no pitch as an input.
    """
    actuator = model.pitch_actuator
    if actuator is None:
        raise ValueError(f"pitch_margin: expected a model with pitch as an input, got {model.name}")
    frequency = FREQUENCIES
    controller = _slow(agent, frequency)[:, None, None] * agent.gain[0]
    if len(agent.gain) > 1:
        passing = _passing(model)
        frequency = np.sort(np.concatenate([FREQUENCIES, passing - BESIDE, [passing], passing + BESIDE]))
        controller = _slow(agent, frequency)[:, None, None] * agent.gain[0]
        # x_c + i x_s at a frequency is the conjugate of the components at twice the azimuth at what that lacks of three
        # turns; x_c - i x_s, which whirls the other way, is at as much more.
        factor = agent.gain[1, 0, 0] + 1j * agent.gain[1, 1, 0]
        back = np.conj(factor * _slow(agent, passing - frequency))
        on = factor * _slow(agent, passing + frequency)
        controller = controller + np.linalg.inv(_WHIRLS) @ (np.stack([on, back], axis=1)[..., None] * _WHIRLS)
    loop = -cyclic_response(model, actuator, frequency) @ controller
    sensitivity = np.linalg.inv(np.eye(2) + loop)
    peaks = np.linalg.norm(2.0 * sensitivity - np.eye(2), 2, axis=(1, 2))
    worst = int(np.argmax(peaks))
    return DiskMargin(float(2.0 / peaks[worst]), float(frequency[worst]))


def _slow(agent: IndividualPitch, frequency: Array) -> ComplexArray:
    """Notch, integral and hold at frequencies (F,) of the components that they see [Hz], below zero too; in seconds."""
    # An action is held, so what is asked is on average half of one late; the azimuth's lead makes up for the turn.
    delay = np.exp(-2j * np.pi * frequency * agent.interval)
    _, notched = scipy.signal.freqz(*agent.notch, worN=frequency, fs=1.0 / agent.interval)
    held = np.sinc(frequency * agent.interval) * np.exp(-1j * np.pi * frequency * agent.interval)
    return np.asarray(notched * held * agent.interval / (1.0 - agent.leak * delay))
