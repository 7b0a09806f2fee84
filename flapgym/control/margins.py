"""How much a loop bears that its design did not know: delay, and gain and phase of all three blades at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aeroelastic.model import TurbineModel
from flapgym.control.channels import controller_channels
from flapgym.control.closed_loop import closed_loop
from flapgym.state_space import Array, StateSpace
from flapgym.turbine.fields import Count

# Dense where tower and whirl modes stand, wide enough for the flap's own dynamics [Hz].
FREQUENCIES = np.unique(
    np.concatenate([np.geomspace(0.005, 60.0, 200), np.linspace(0.1, 0.8, 200), np.linspace(0.8, 12.0, 300)])
)
RESONANT = 0.1
"""Damping ratio below which a mode of the closed loop has frequencies of its own beside the grid."""


@dataclass(frozen=True)
class DiskMargin:
    """The symmetric disk margin alpha, and the gain and phase it guarantees.

    Attributes
    ----------
    alpha : float
        1 / max |S - 1/2|: the loop stays stable while each blade's measurement is multiplied by (1 + d/2) / (1 - d/2)
        with any |d| < alpha, the blades' d being alike or not; 0 to 2.
    frequency : float
        Where the margin is least [Hz].
    """

    alpha: float
    frequency: float

    @property
    def gain(self) -> tuple[float, float]:
        """Least and largest gain at no change of phase; from two on there is no bound."""
        half = 0.5 * self.alpha
        return (1.0 - half) / (1.0 + half), (1.0 + half) / (1.0 - half) if half < 1.0 else np.inf

    @property
    def phase(self) -> float:
        """Change of phase borne at no change of gain [rad]."""
        return float(2.0 * np.arctan(0.5 * self.alpha))


def disk_margin(
    model: TurbineModel,
    controller: StateSpace,
    plant: StateSpace | None = None,
    frequency: Array = FREQUENCIES,
) -> DiskMargin:
    """Disk margin at the three measured moments together, from the largest singular value of S - T (Seiler 2020).

    Multi-blade components are scaled to keep the sum of squares over the blades, so the largest gain is that of the
    blades' own frames. The peaks stand at the closed loop's own modes, some of them a hundredth of a hertz wide: each
    lightly damped one is looked at where it stands and half its width to either side, the rest on a grid.
    """
    loop = closed_loop(model, controller, plant=plant)
    channels = controller_channels([name for name in loop.outputs if name.startswith("flap_angle")])
    moment = loop.select(inputs=channels.named("noise"), outputs=channels.named("rbm"))
    scale = np.sqrt(channels.weight)
    # Noise n on the measurement: the loop sees S n, of which the true moment is S n - n = -T n.
    frequency = np.union1d(frequency, _resonances(moment))
    response = moment.frequency_response(frequency) * scale[:, None] / scale
    size = np.linalg.norm(2.0 * response + np.eye(channels.count), ord=2, axis=(1, 2))
    worst = int(size.argmax())
    return DiskMargin(float(2.0 / size[worst]), float(frequency[worst]))


def _resonances(loop: StateSpace) -> Array:
    """Frequencies [Hz] of the lightly damped modes, and those at which their response is down by 3 dB."""
    values = np.linalg.eigvals(loop.A)
    pole = np.log(values[values.imag > 0.0]) / (2.0 * np.pi * loop.time_step)
    pole = pole[-pole.real < RESONANT * np.abs(pole)]
    return np.concatenate([pole.imag + side * pole.real for side in (-1.0, 0.0, 1.0)])


def late_measurement(controller: StateSpace, steps: int, rotor_speed: float) -> StateSpace:
    """The controller whose moments arrive so many steps late, its flaps' own motion in time.

    In multi-blade coordinates what arrives late is turned on, as a controller that knows its delay does.
    """
    Count(at_least=0).check(steps, "late_measurement.steps")
    channels = controller_channels(controller.inputs)
    m = channels.count
    turn = channels.turn(rotor_speed * controller.time_step)
    for _ in range(steps):
        n = controller.order
        rbm, flap = controller.B[:, :m], controller.B[:, m:]
        controller = StateSpace(
            A=np.block([[controller.A, rbm], [np.zeros((m, n + m))]]),
            B=np.block([[np.zeros((n, m)), flap], [turn, np.zeros((m, 2 * m))]]),
            C=np.hstack([controller.C, controller.D[:, :m]]),
            D=np.hstack([np.zeros((m, m)), controller.D[:, m:]]),
            time_step=controller.time_step,
            inputs=controller.inputs,
            outputs=controller.outputs,
        )
    return controller


def delay_margin(model: TurbineModel, controller: StateSpace, longest: int = 60) -> int:
    """Largest delay of the measurement, in steps, up to which the full closed loop is stable; at most `longest`.

    Every delay is tried in turn: beyond an unstable one a loop may be stable again.
    """
    Count(at_least=1).check(longest, "delay_margin.longest")
    for delay in range(1, longest + 1):
        late = late_measurement(controller, delay, model.rotor_speed)
        if closed_loop(model, late).spectral_radius() >= 1.0:
            return delay - 1
    return longest
