"""The model in the forms that control designers work with: python-control, scipy.signal, MATLAB.

A state space of many lightly damped modes sampled every few milliseconds has no transfer function in double precision:
its poles crowd about one, and the coefficients of their polynomial hold nothing of them from some eight states on.
Whatever passes through one (scipy's `freqresp`, `bode` and `to_tf`, python-control's `ss2tf`) answers wrongly and
without a word. Matrices, frequency responses, and poles and zeros do not lose anything.
"""

from __future__ import annotations

import io
import os
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.io
import scipy.linalg
import scipy.signal
from numpy.typing import ArrayLike

from flapgym.core.atomic import write_atomically
from flapgym.core.fields import Numbers
from flapgym.core.state_space import StateSpace
from flapgym.model.reduced import reduced_blade, reduced_model
from flapgym.model.turbine_model import TurbineModel

if TYPE_CHECKING:
    import control

__all__ = [
    "ExportWarning",
    "reduced_blade",
    "reduced_model",
    "save_mat",
    "to_control",
    "to_dlti",
    "to_frd",
    "to_zpk",
]

LARGEST_TRANSFER_FUNCTION = 6
"""States up to which a transfer function holds three digits, measured on the blade reduced and sampled at 7 ms."""
CHECKED = np.geomspace(0.01, 50.0, 60)
"""Frequencies [Hz] at which poles and zeros are held to the matrices."""
INFINITE = 1e-9
"""A zero beyond the reciprocal of this is none."""
AGREEMENT = 1e-6
"""Of a channel's largest response, by how much they may differ."""


class ExportWarning(UserWarning):
    """What was handed out is exact, but functions of the library it goes to are not."""


def to_control(system: StateSpace) -> control.StateSpace:
    """The system as a python-control ``StateSpace`` with the same input and output names.

    Simulation, frequency responses and designs on the matrices are exact; `ss2tf` is not, nor is `balred`, which knows
    nothing of the units: see `to_zpk` and `reduced_blade`.

    Raises
    ------
    ImportError
        If python-control is not installed; it comes with ``flapgym[baselines]``.

    Warns
    -----
    ExportWarning
        If the order is beyond what a transfer function holds.
    """
    import control  # only those who ask for it need it

    _warn(system, "python-control's ss2tf, tf and balred")
    return control.ss(
        system.A,
        system.B,
        system.C,
        system.D,
        system.time_step,
        inputs=list(system.inputs),
        outputs=list(system.outputs),
    )


def to_frd(system: StateSpace, frequency: ArrayLike) -> control.FRD:
    """Frequency responses as a python-control ``FrequencyResponseData`` with the same names.

    Parameters
    ----------
    system : StateSpace
    frequency : (nf,) array_like
        [Hz], increasing, from zero to half the sampling frequency; python-control counts in rad/s.

    Raises
    ------
    ImportError
        If python-control is not installed; it comes with ``flapgym[baselines]``.
    ValueError
        If a frequency is out of range.
    """
    import control

    highest = 0.5 / system.time_step
    hertz = Numbers(dimension="frequency", axes=1, at_least=0.0, at_most=highest).check(
        frequency, "to_frd.frequency"
    )
    return control.FRD(
        np.moveaxis(system.frequency_response(hertz), 0, -1),
        2.0 * np.pi * hertz,
        system.time_step,
        inputs=list(system.inputs),
        outputs=list(system.outputs),
    )


def to_dlti(system: StateSpace) -> scipy.signal.dlti:
    """The system as a ``scipy.signal.dlti``, which knows no names: for `dlsim`, which works with its matrices.

    Warns
    -----
    ExportWarning
        If the order is beyond what a transfer function holds, through which scipy takes frequency responses.
    """
    _warn(system, "scipy's freqresp, bode and to_tf")
    return scipy.signal.dlti(system.A, system.B, system.C, system.D, dt=system.time_step)


def to_zpk(system: StateSpace) -> dict[tuple[str, str], scipy.signal.dlti]:
    """Each channel of the system as zeros, poles and gain, by its output's and input's name.

    scipy's frequency responses of these are exact; `scipy.signal.zpk2tf` and `to_tf` are not.

    Raises
    ------
    ValueError
        If a channel's zeros do not reproduce its response to a millionth of its largest.
    """
    poles = np.linalg.eigvals(system.A)
    response = system.frequency_response(CHECKED)
    z = np.exp(2j * np.pi * CHECKED * system.time_step)
    found = {}
    for row, output in enumerate(system.outputs):
        for column, source in enumerate(system.inputs):
            exact = response[:, row, column]
            zeros = _zeros(system, row, column)
            shape = _product(z, zeros, poles)
            # The gain where the channel answers most, and nearly real elsewhere too if the zeros are right.
            most = int(np.abs(exact).argmax())
            gain = float((exact[most] / shape[most]).real) if exact[most] else 0.0
            largest, error = np.abs(exact).max(), np.abs(gain * shape - exact).max()
            if error > AGREEMENT * largest:
                raise ValueError(
                    f"to_zpk: {output} of {source}: zeros and poles miss the response by {error / largest:.1e} of its "
                    "largest; take the matrices or to_frd"
                )
            found[output, source] = scipy.signal.dlti(zeros, poles, gain, dt=system.time_step)
    return found


def _zeros(system: StateSpace, row: int, column: int) -> np.ndarray:
    """Finite zeros of one channel: where [[A - z, B], [C, D]] is singular."""
    n = system.order
    b, c, d = system.B[:, column], system.C[row], system.D[row, column]
    # Scaled, for the moments are in N m and the flaps in radians.
    into, out = np.abs(b).max(initial=0.0) or 1.0, np.abs(c).max(initial=0.0) or 1.0
    pencil = np.block([[system.A, b[:, None] / into], [c[None] / out, np.array([[d / into / out]])]])
    numerator, denominator = scipy.linalg.eigvals(
        pencil, np.diag([*[1.0] * n, 0.0]), homogeneous_eigvals=True
    )
    finite = np.abs(denominator) > INFINITE * np.abs(numerator)
    return np.asarray(numerator[finite] / denominator[finite])


def _product(z: np.ndarray, zeros: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """The product of z - zeros over that of z - poles, by their logarithms: hundreds of factors leave the range."""
    logarithm = np.log(z[:, None] - zeros).sum(axis=1) - np.log(z[:, None] - poles).sum(axis=1)
    return np.asarray(np.exp(logarithm))


def _warn(system: StateSpace, unsafe: str) -> None:
    if system.order > LARGEST_TRANSFER_FUNCTION:
        warnings.warn(
            f"{unsafe} pass through a transfer function or know no units, and lose all digits at order "
            f"{system.order}: take StateSpace.frequency_response, or to_frd, to_zpk and reduced_blade of "
            "flapgym.model.export",
            ExportWarning,
            stacklevel=3,
        )


def save_mat(model: TurbineModel, path: str | os.PathLike[str]) -> None:
    """Write turbine and single blade as structs A, B, C, D, Ts, InputName, OutputName to a MATLAB file.

    With unequal blades `turbine` is the mean over azimuth, and a struct `periodic` holds what turns
    (`flapgym.model.harmonics.PeriodicPart`).
    In MATLAB: ``m = load('model.mat'); sys = ss(m.turbine.A, m.turbine.B, m.turbine.C, m.turbine.D, m.turbine.Ts)``.
    """
    content: dict[str, Any] = {
        "turbine": _struct(model.turbine),
        "blade": _struct(model.blade),
        "name": model.name,
        "hash": model.hash,
        "wind_speed": model.wind_speed,
        "rotor_speed": model.rotor_speed,
    }
    if model.periodic is not None:
        names = ("left", "core", "right", "forcing")
        content["periodic"] = {name: getattr(model.periodic, name) for name in names}
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, content, oned_as="column")
    write_atomically(path, buffer.getvalue())


def _struct(system: StateSpace) -> dict[str, Any]:
    # As cell arrays: strings of one length, padded, are not what MATLAB takes for names.
    names = {
        "InputName": np.array(system.inputs, dtype=object),
        "OutputName": np.array(system.outputs, dtype=object),
    }
    return {"A": system.A, "B": system.B, "C": system.C, "D": system.D, "Ts": system.time_step, **names}
