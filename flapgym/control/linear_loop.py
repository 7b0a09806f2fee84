"""What the linear loop of an agent and the turbine says before any simulation: whether it is stable, and its margin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.control.agent import OBSERVATION_SCALES, Agent, OpenLoop, blade_entries
from flapgym.control.blade_controller import BladeController, acceleration_limits
from flapgym.control.channels import MULTIBLADE, ROTOR, controller_channels
from flapgym.control.closed_loop import closed_loop, require_flaps
from flapgym.control.growth import Growth, agent_growth, growth
from flapgym.control.individual_pitch import IndividualPitch, pitch_margin
from flapgym.control.margins import DiskMargin, sensitivity_difference
from flapgym.control.mpc import PredictiveController
from flapgym.control.peak_gain import peak_gain
from flapgym.control.policy import Policy
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel


@dataclass(frozen=True)
class LinearLoop:
    """The loop of an agent and the turbine, stops left out.

    Attributes
    ----------
    stable : bool or None
        None where only the margin is known.
    growth : Growth or None
        What grows in an unstable one.
    margin : DiskMargin or None
        At the three measured moments together; for individual pitch control alone, at their components. None for
        controllers in the blades' own frames, whose loop is periodic: `flapgym.control.periodic` takes minutes.
    """

    stable: bool | None
    growth: Growth | None
    margin: DiskMargin | None


def linear_loop(agent: Agent, model: TurbineModel) -> LinearLoop | None:
    """The linear loop of an agent with the turbine alone, without an environment's sensors and actuators.

    Predictive control counts with no stop in sight, a policy of each blade alone as it answers to small signals about
    rest, its actions held as it holds them. With unequal blades the turbine is the mean over the revolution. None for
    flaps at rest and for agents of which no such loop is known.
    """
    if isinstance(agent, IndividualPitch):
        # Of a loop of flaps beside it the two would have to be taken together.
        alone = isinstance(agent.beside, OpenLoop) and model.pitch_actuator is not None
        return LinearLoop(None, None, pitch_margin(model, agent)) if alone else None
    if isinstance(agent, Policy):
        if not agent.per_blade or not set(agent.observe) <= OBSERVATION_SCALES.keys():
            return None
        return _judged(held_policy_loop(agent, model))
    if isinstance(agent, PredictiveController):
        system = agent.unconstrained
    elif isinstance(agent, BladeController | RotorController):
        system = agent.system
    else:
        return None
    if controller_channels(system.inputs).suffixes == ROTOR.suffixes:
        grows = agent_growth(agent, model)
        return LinearLoop(grows is None, grows, None)
    return _judged(closed_loop(model, system))


def _judged(loop: StateSpace) -> LinearLoop:
    """Of a time-invariant loop from noise on the measured moments, as `disk_margin` has it."""
    grows = growth(loop)
    if grows is not None:
        return LinearLoop(False, grows, DiskMargin(0.0, grows.frequency))
    peak, frequency = peak_gain(sensitivity_difference(loop))
    return LinearLoop(True, None, DiskMargin(2.0 / peak, frequency))


def held_policy_loop(policy: Policy, model: TurbineModel) -> StateSpace:
    """Turbine and a policy of each blade alone, about rest, from one of its actions to the next.

    Time-invariant in multi-blade coordinates: each blade has the same gains, and its acceleration stays its own while
    the axes turn on. Inputs noise on the measured moments [N m]; outputs moments, flap angles and rates, as of
    `closed_loop`.

    Raises
    ------
    ValueError
        If the policy is not of each blade alone, observes what is not moment, angle or rate, or has another number of
        flaps a blade than the model.
    """
    if not policy.per_blade or not set(policy.observe) <= OBSERVATION_SCALES.keys():
        raise ValueError(
            f"held_policy_loop: expected a policy of each blade alone that observes {', '.join(OBSERVATION_SCALES)}, "
            f"got {policy.name}, of {', '.join(policy.observe)}"
        )
    require_flaps("held_policy_loop.policy", policy.flaps, model)
    channels = MULTIBLADE.with_flaps(policy.flaps)
    plant = model.turbine.select(channels.flap_inputs, channels.moments)
    n, motion, dt = plant.order, 2 * channels.actions, model.time_step
    turns = channels.flap_turn(model.rotor_speed * dt)
    step = np.block([[plant.A, plant.B], [np.zeros((motion, n)), np.kron([[1.0, dt], [0.0, 1.0]], turns)]])
    push = np.vstack([np.zeros((n, channels.actions)), np.kron([[0.5 * dt**2], [dt]], turns)])
    after, held, command = np.eye(n + motion), np.zeros_like(push), np.eye(channels.actions)
    for _ in range(policy.steps_per_action):
        after, held = step @ after, step @ held + push @ command
        command = turns @ command
    moments = np.hstack([plant.C, plant.D])
    seen = np.vstack([moments, np.eye(motion, n + motion, n)])
    gains = _gains(policy, model)
    return StateSpace(
        A=after + held @ gains @ seen,
        B=held @ gains[:, : channels.count],
        C=seen,
        D=np.zeros((len(seen), channels.count)),
        time_step=policy.steps_per_action * dt,
        inputs=channels.named("noise"),
        outputs=(*channels.moments, *channels.flap_inputs),
    )


def _gains(policy: Policy, model: TurbineModel) -> Array:
    """Accelerations (3 F,) per moments, angles and rates (3 + 6 F,), signal by signal, of a policy about rest [SI]."""
    flaps = policy.flaps
    limits = np.array(acceleration_limits(model))
    slope, first = policy.slope_at_rest(), 0
    columns = {name: np.zeros((flaps, blade_entries((name,), flaps))) for name in OBSERVATION_SCALES}
    for name in policy.observe:
        size = blade_entries((name,), flaps)
        columns[name] = limits[:, None] * slope[:, first : first + size] / OBSERVATION_SCALES[name]
        first += size
    return np.hstack([np.kron(columns[name], np.eye(3)) for name in ("rbm", "flap_angle", "flap_rate")])
