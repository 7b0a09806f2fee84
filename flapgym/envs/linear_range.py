"""The wind up to which a model that is linear about its mean wind is taken at its word, and the warning beyond."""

from __future__ import annotations

import warnings

import numpy as np

from flapgym.core.wording import number
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Wind, gust_of, turbulence_of

LINEAR_SHARE = 0.3
"""Of the mean wind. A load that goes with the square of the wind has then changed by 1.3^2 - 1 = 0.69, where the linear
model says 0.60: it misses an eighth of the change, and more beyond."""

_TOLD: set[tuple[str, str]] = set()
"""Models, by hash, and winds that this process has been warned of: the same again in every episode tells nothing."""


class LinearRangeWarning(UserWarning):
    """A linear model meets wind that departs from its mean wind by more than `LINEAR_SHARE` of it."""


def in_words(wind: Wind) -> str:
    """Which wind it is, in a few words."""
    parts = ["homogeneous turbulence" if wind.field is None else f"field {turbulence_of(wind.field).kind}"]
    if wind.gust is not None:
        gust = f"gust {gust_of(wind.gust).kind}"
        parts = [gust] if wind.turbulence_intensity == 0.0 else [*parts, gust]
    return " and ".join(parts)


def whence(generator: np.random.Generator, realisation: int | None) -> str:
    """Where an episode's numbers come from, if known: its realisation, or the seed of the generator that drew them."""
    if realisation is not None:
        return f", realisation {realisation}"
    entropy = getattr(generator.bit_generator.seed_seq, "entropy", None)
    # A generator that nobody has seeded has 128 random bits there.
    return f", seed {entropy}" if isinstance(entropy, int) and entropy < 2**63 else ""


def warn_beyond(model: TurbineModel, wind: str, drawn: str, strongest: float) -> None:
    """Warn, once a process for each model and wind, that an episode goes beyond the linear range.

    Parameters
    ----------
    model : TurbineModel
    wind : str
        `in_words`.
    drawn : str
        `whence`.
    strongest : float
        Largest departure of the mean over the rotor from the mean wind [m/s].
    """
    if (model.hash, wind) in _TOLD:
        return
    _TOLD.add((model.hash, wind))
    warnings.warn(
        f"wind: {wind}{drawn}: {strongest:.3g} m/s over the rotor beside a mean wind of "
        f"{number(model.wind_speed)} m/s is more than {100.0 * LINEAR_SHARE:.0f} %, where the linear model "
        f"{model.name} holds no longer; take weaker wind or a model built for another wind speed, or read these loads "
        "as extrapolated (said once)",
        LinearRangeWarning,
        stacklevel=5,
    )
