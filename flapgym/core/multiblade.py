"""Multi-blade (Coleman) coordinates: signals of three blades and their components, to and fro.

u_b = u_0 + u_c cos(theta_b) + u_s sin(theta_b), theta_b = theta + 2 pi b / 3 (b = 0, 1, 2): three numbers for three,
so any signal of the blades has components, at every azimuth. With three equal blades on a tower the azimuth drops out
of the coupled equations, so the A(theta) of the paper's eq. 14 becomes one constant matrix. Frozen-azimuth eigenvalues
are not physical modes; those of the transformed system are.
"""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import BLADES, Array, ComplexArray

# Sum over the blades of cos^2 and sin^2 is 3/2, of one is 3: the virtual work of the components.
WORK_WEIGHTS = np.array([3.0, 1.5, 1.5])

# v in the frame of the blade at theta is (P_0 + P_c cos theta + P_s sin theta) v in the hub's
# non-rotating frame: the rotation about x by -theta.
_AXIAL = np.diag([1.0, 0.0, 0.0])
_COSINE = np.diag([0.0, 1.0, 1.0])
_SINE = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def blade_azimuths(azimuth: Array | float) -> Array:
    """Azimuths (..., 3) [rad] of the three blades for rotor azimuth (...)."""
    return np.asarray(azimuth)[..., None] + 2.0 * np.pi / BLADES * np.arange(BLADES)


def to_blades(components: Array, azimuth: Array | float, harmonic: int = 1) -> Array:
    """Blade signals (..., 3) from components (..., 3) at rotor azimuth (...) [rad], of a multiple of it."""
    angle = harmonic * blade_azimuths(azimuth)
    return np.asarray(
        components[..., :1] + components[..., 1:2] * np.cos(angle) + components[..., 2:] * np.sin(angle)
    )


def to_components(blades: Array, azimuth: Array | float, harmonic: int = 1) -> Array:
    """Components (..., 3) from blade signals (..., 3) at rotor azimuth (...) [rad], of a multiple of it.

    Of a multiple that three divides there are none: its cosine is the same on all blades.
    """
    angle = harmonic * blade_azimuths(azimuth)
    mean = blades.mean(axis=-1)
    cosine = 2.0 / BLADES * (blades * np.cos(angle)).sum(axis=-1)
    sine = 2.0 / BLADES * (blades * np.sin(angle)).sum(axis=-1)
    return np.stack([mean, cosine, sine], axis=-1)


def component_harmonics(harmonics: ComplexArray) -> ComplexArray:
    """Harmonics of the components of what each blade meets at its own azimuth.

    Parameters
    ----------
    harmonics : (M + 1, ...) complex
        c_m of u(theta) = Re sum over m of c_m exp(i m theta), m = 0 to M, where M = 3 N + 1: each component then has
        all the harmonics that fall on it.

    Returns
    -------
    (N + 1, ..., 3) complex
        d_k of the components (u_0, u_c, u_s)(theta) = Re sum over k of d_k exp(3 i k theta); d_0 is real.

    Raises
    ------
    ValueError
        If M is no multiple of three and one.
    """
    if len(harmonics) % BLADES != 2:
        raise ValueError(
            f"harmonics: expected those from 0 to a multiple of {BLADES} and one, got {len(harmonics)} of them"
        )
    # The sum over the blades of exp(i m theta_b) is zero unless 3 divides m, and cos and sin move m by one: of the
    # harmonics, n = 3 k stays in u_0, and its neighbours n - 1 and n + 1 are those of u_c and u_s. Harmonic 1 has no
    # other neighbour at n = 0 than itself, as there is no harmonic -1.
    middle = harmonics[:-1:BLADES]
    above = harmonics[1::BLADES]
    below = np.concatenate([np.zeros_like(harmonics[:1]), harmonics[2:-1:BLADES]])
    found = np.stack([middle, below + above, 1j * (above - below)], axis=-1)
    found[0].imag = 0.0  # of a constant only the real part is told
    return found


def hub_components() -> Array:
    """Components (3, 6, 6) of the map from hub motion (u, phi) in the fixed frame to a blade's frame."""
    return np.stack([np.kron(np.eye(2), part) for part in (_AXIAL, _COSINE, _SINE)])


def derivative_coupling(rotor_speed: float) -> Array:
    """J (3, 3) with d/dt (u_0, u_c, u_s) of the blade signal = (u_0, u_c, u_s)' + J (u_0, u_c, u_s)."""
    return rotor_speed * np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def on_rotor() -> Array:
    """Matrix (3, 3) from components (0, c, s) that turn with the rotor, its azimuth counted as zero, to blades."""
    angle = blade_azimuths(0.0)
    return np.stack([np.ones(BLADES), np.cos(angle), np.sin(angle)], axis=-1)
