"""PD with a leaky integral of the moment, and the same on multi-blade components as individual pitch control has it.

The integral leaks because an integrator of the moment would ask a flap between stops for what only the trim can give.
Without an integral this is the PD controller of `flapgym.control.pd`, state for state but one that does nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from flapgym.control.blade_controller import BladeController, acceleration_limits
from flapgym.control.channels import MULTIBLADE
from flapgym.control.pd import PDGains, pd_controller, pd_start
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import Array
from flapgym.core.fields import Quantity
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel


@dataclass(frozen=True)
class PIDGains(PDGains):
    """Those of the PD, and an integral: the demand is proportional (M + slope's part + integral_gain times it).

    Attributes
    ----------
    integral_gain : float
        What the leaky integral comes to for a steady moment, beside the moment's own one; zero makes it the PD.
    leak_time : float
        Time in which the integral forgets [s]; for faster moments it is an integral of integral_gain / leak_time.
    """

    integral_gain: float
    leak_time: float

    def __post_init__(self) -> None:
        super().__post_init__()
        Quantity("number", at_least=0.0).check(self.integral_gain, "pid.integral_gain")
        Quantity("time", above=0.0).check(self.leak_time, "pid.leak_time")


def pid_agent(name: str, model: TurbineModel, gains: PIDGains) -> BladeController:
    """Three copies of the PID controller at the step of `model`, under the name given."""
    flaps = len(model.flaps)
    system = pid_controller(gains, model.time_step, flaps)
    return BladeController(name, system, pid_start(flaps), acceleration_limits(model), model.hash)


def pid_start(flaps: int) -> Array:
    """First state (2, 1 + 2 F) per unit of the first inputs: no slope, and nothing integrated yet."""
    return np.vstack([pd_start(flaps), np.zeros((1, 1 + 2 * flaps))])


def pid_controller(gains: PIDGains, time_step: float, flaps: int = 1) -> StateSpace:
    """States [low-passed moment, leaky integral of the moment]; inputs and outputs as of `pd_controller`."""
    pd = pd_controller(gains, time_step, flaps)
    keep = np.exp(-time_step / gains.leak_time)
    integral = -(gains.servo_frequency**2) * gains.proportional * gains.integral_gain
    return StateSpace(
        A=block_diag(pd.A, keep),
        B=np.vstack([pd.B, (1.0 - keep) * np.eye(1, 1 + 2 * flaps)]),
        C=np.hstack([pd.C, np.full((flaps, 1), integral)]),
        D=pd.D,
        time_step=time_step,
        inputs=pd.inputs,
        outputs=pd.outputs,
    )


def multiblade_pid_agent(
    name: str, model: TurbineModel, collective: PIDGains, cyclic: PIDGains
) -> RotorController:
    """Individual flap control: collective, tilt and yaw channels as the wind industry has for individual pitch.

    The moments of the blades are turned into components of the fixed frame by the azimuth, each channel has a PID of
    its own, and the demands are turned back. Tilt and yaw share their gains, so the law knows no preferred azimuth.
    The servo acts flap by flap on motions read after the stops, the flaps of a blade having one demand. In the linear
    turbine nothing stands at multiples of the blade passing frequency, so there is no notch; the slope's low-pass is
    the only filter.
    """
    flaps = len(model.flaps)
    channels = [pid_controller(gains, model.time_step, flaps) for gains in (collective, cyclic, cyclic)]
    signals = MULTIBLADE.with_flaps(flaps)
    system = StateSpace(
        A=block_diag(*(each.A for each in channels)),
        B=_by_signal([each.B for each in channels]),
        C=_by_signal([each.C.T for each in channels]).T,
        D=_by_signal([each.D for each in channels])[_signal_order(flaps, len(channels))],
        time_step=model.time_step,
        inputs=signals.inputs,
        outputs=signals.outputs,
    )
    start = _by_signal([pid_start(flaps)] * 3)
    return RotorController(name, system, start, acceleration_limits(model), model.hash)


def _by_signal(parts: list[Array]) -> Array:
    """Block diagonal with the columns signal by signal: the moments of all channels, then angles, then rates."""
    joined = block_diag(*parts)
    signals = parts[0].shape[1]
    return np.asarray(joined[:, _signal_order(signals, len(parts))])


def _signal_order(signals: int, channels: int) -> list[int]:
    """Places of what stands channel by channel, signal by signal."""
    return [channel * signals + signal for signal in range(signals) for channel in range(channels)]
