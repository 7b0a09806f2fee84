"""From what an interval gave, blade by blade, to what a plant tells: the same for every way in numpy to compute it."""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import Array, BoolArray
from flapgym.plant.parameters import Loads, Parameters


def tell(
    parameters: Parameters,
    *,
    rbm: Array,
    others: Array,
    fixed: Array,
    wind: Array,
    motion: Array,
    travel: Array,
    stopped: BoolArray,
    azimuth: Array,
) -> Loads:
    """Loads of an interval of k samples, or of the one sample of a reset.

    Parameters
    ----------
    parameters : Parameters
    rbm : (n, k, blades) float
        Root moments at samples 1 to k [N m].
    others : (n, computed - 1, kept, blades) float
        The other blade quantities at the samples kept.
    fixed : (n, fixed, kept) float
        Fixed outputs at the samples kept.
    wind : (n, kept) float
        [m/s].
    motion : (k + 1, 2, blades A, n) float
        Angle and rate of the actuators at samples 0 to k [rad, rad/s]; the last sample is enough.
    travel : (blades A, n) float
        Way since the reset [rad].
    stopped : (blades A, n) bool
    azimuth : (n,) float
        Of blade 1 at the last sample [rad].
    """
    p, s, n = parameters, parameters.sizes, len(rbm)
    unknown = np.full((n, (s.blade_places - s.blade_outputs) * s.blades), np.nan)
    unknown_fixed = np.full((n, s.fixed_places - s.fixed_outputs), np.nan)
    heading = np.empty((n, 3))
    heading[:, 0], heading[:, 1], heading[:, 2] = azimuth % (2.0 * np.pi), np.cos(azimuth), np.sin(azimuth)
    last = np.concatenate(
        [
            rbm[:, -1],
            others[:, :, -1].reshape(n, -1),
            unknown,
            motion[-1].reshape(-1, n).T,
            travel.T,
            stopped.T,
            fixed[:, :, -1],
            unknown_fixed,
            wind[:, -1:],
            heading,
        ],
        axis=1,
    )
    samples = np.empty((n, 0, 0))
    if s.record:
        flat = others.transpose(0, 2, 1, 3).reshape(n, rbm.shape[1], -1)
        flaps = motion[1:].transpose(3, 0, 1, 2).reshape(n, rbm.shape[1], -1)
        samples = np.concatenate([rbm, flat, flaps, fixed.transpose(0, 2, 1), wind[:, :, None]], axis=2)
    share = motion[1:, 0, : p.all_flaps] / p.angle_limit[: p.all_flaps, None]
    return Loads(
        last=last,
        rbm_square=np.einsum("nkb,nkb->nb", rbm, rbm) / rbm.shape[1],
        angle_square=np.einsum("kfn,kfn->n", share, share) / max(1, share.shape[0] * share.shape[1]),
        fixed_square=np.einsum("nck,nck->nc", fixed, fixed) / fixed.shape[2],
        samples=samples,
    )
