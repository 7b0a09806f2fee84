"""Multi-blade (Coleman) coordinates: the exact time-invariant form of three equal blades on a tower.

A blade signal is written u_b = u_0 + u_c cos(theta_b) + u_s sin(theta_b), theta_b = theta + 2 pi b / 3.
With three equal blades the azimuth drops out of the coupled equations, so the A(theta) of the paper's
eq. 14 becomes one constant matrix. Frozen-azimuth eigenvalues are not physical modes; those of the
transformed system are.
"""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import blade_azimuths as blade_azimuths
from flapgym.core.multiblade import to_blades as to_blades
from flapgym.core.multiblade import to_components as to_components

# Sum over the blades of cos^2 and sin^2 is 3/2, of one is 3: the virtual work of the components.
WORK_WEIGHTS = np.array([3.0, 1.5, 1.5])

# v in the frame of the blade at theta is (P_0 + P_c cos theta + P_s sin theta) v in the hub's
# non-rotating frame: the rotation about x by -theta.
_AXIAL = np.diag([1.0, 0.0, 0.0])
_COSINE = np.diag([0.0, 1.0, 1.0])
_SINE = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


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
