"""Loads of every channel of a record at several S-N slopes, and how they change against open loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flapgym.core.arrays import Array
from flapgym.core.fields import Numbers, Quantity, TupleOf
from flapgym.evaluation.bootstrap import Estimate, paired_change, summed_damage_change
from flapgym.evaluation.metrics import (
    check_record,
    damage_equivalent_loads,
    root_mean_square,
    summed_damage_load,
)
from flapgym.evaluation.record import OPERATION, Record, unit_of

SLOPES = (3.0, 4.0, 5.0, 8.0, 10.0, 12.0)
"""Of the S-N curve: 3 to 5 as of welded steel, 8 to 12 as of composites."""


@dataclass(frozen=True, eq=False)
class ChannelLoads:
    """One channel of N realisations at P places: three blades, or one where it is not the blades'.

    Attributes
    ----------
    channel : str
        Name of the model's output.
    unit : str
        Of rms and equivalent loads; empty if `flapgym.evaluation.record.UNITS` does not know the name.
    rms : (N, P) float
        About zero.
    slopes : tuple of float
        S-N slopes.
    equivalent : (slopes, N, P) float
        Damage-equivalent load, a range.
    turbulence : ChannelLoads or None
        The same of turbulence alone (`split`); None where nothing but turbulence loads the turbine.
    """

    channel: str
    unit: str
    rms: Array
    slopes: tuple[float, ...]
    equivalent: Array
    turbulence: ChannelLoads | None = None


@dataclass(frozen=True)
class SlopeScore:
    """The damage-equivalent load of a channel at one slope.

    Attributes
    ----------
    slope : float
    equivalent_load : float
        Of all places and realisations together, from their summed damage, in the channel's unit.
    change : Estimate
        Against open loop, a fraction: mean of the realisations' ratios.
    summed_change : Estimate
        The same of `equivalent_load`: the damage summed first, so that the largest loads decide.
    """

    slope: float
    equivalent_load: float
    change: Estimate
    summed_change: Estimate


@dataclass(frozen=True)
class ChannelScore:
    """A channel under one agent, against open loop.

    Attributes
    ----------
    channel, unit : str
        As of `ChannelLoads`.
    rms : float
        Mean over places and realisations.
    rms_change : Estimate
        Mean of the realisations' ratios to open loop less one.
    slopes : tuple of SlopeScore
    turbulence : ChannelScore or None
        The same of turbulence alone, against open loop's turbulence alone; None where nothing else loads the turbine.
    """

    channel: str
    unit: str
    rms: float
    rms_change: Estimate
    slopes: tuple[SlopeScore, ...]
    turbulence: ChannelScore | None = None


@dataclass(frozen=True, eq=False)
class Split:
    """All loads of a channel, and those of turbulence alone.

    Attributes
    ----------
    slopes : tuple of float
        S-N slopes.
    all_rms, turbulence_rms : (...) float
        About zero.
    all_equivalent, turbulence_equivalent : (slopes, ...) float
        Damage-equivalent load, a range.
    """

    slopes: tuple[float, ...]
    all_rms: Array
    turbulence_rms: Array
    all_equivalent: Array
    turbulence_equivalent: Array


def channel_loads(
    record: Record, slopes: Sequence[float] = SLOPES, steady: Mapping[str, Array] | None = None
) -> tuple[ChannelLoads, ...]:
    """Rms and damage-equivalent loads of the root moments and of every further output of the model that is a load.

    Parameters
    ----------
    record : Record
    slopes : sequence of float
        S-N slopes.
    steady : mapping of str to (N, T, 3) or (N, T) float, optional
        What is steady does to every channel (`flapgym.evaluation.steady_loads`): turbulence alone is told, too.

    Raises
    ------
    ValueError
        If the record's series do not belong together, a channel's steady part has another shape or is missing, or a
        slope is not positive.
    """
    check_record(record)
    found = []
    loads = {name: series for name, series in record.further.items() if name not in OPERATION}
    for channel, series in {"rbm": record.rbm, **loads}.items():
        whole, unit, turbulence = _places_apart(series), unit_of(channel), None
        if steady:
            if channel not in steady:
                raise ValueError(f"steady: expected an entry for {channel}, got {', '.join(steady)}")
            parts = split(whole, _places_apart(steady[channel]), record.time_step, slopes)
            turbulence = ChannelLoads(
                channel, unit, parts.turbulence_rms, parts.slopes, parts.turbulence_equivalent
            )
            rms, equivalent = parts.all_rms, parts.all_equivalent
        else:
            rms, equivalent = root_mean_square(whole), _equivalent(whole, record.time_step, slopes)
        found.append(ChannelLoads(channel, unit, rms, tuple(slopes), equivalent, turbulence))
    return tuple(found)


def _places_apart(series: Array) -> Array:
    """Series (N, T, P), or (N, T) of one place, as (N, P, T)."""
    return np.moveaxis(np.atleast_3d(series), 1, -1)


def joined(parts: Sequence[ChannelLoads]) -> ChannelLoads:
    """One channel's loads of realisations that were measured in parts."""
    first, alone = parts[0], [part.turbulence for part in parts if part.turbulence is not None]
    return ChannelLoads(
        first.channel,
        first.unit,
        np.concatenate([part.rms for part in parts]),
        first.slopes,
        np.concatenate([part.equivalent for part in parts], axis=1),
        joined(alone) if alone else None,
    )


def score_channel(loads: ChannelLoads, reference: ChannelLoads) -> ChannelScore:
    """A channel under an agent against the same under open loop, on the same realisations."""
    alone, still = loads.turbulence, reference.turbulence
    return ChannelScore(
        channel=loads.channel,
        unit=loads.unit,
        rms=float(loads.rms.mean()),
        rms_change=paired_change(loads.rms, reference.rms),
        slopes=tuple(
            SlopeScore(
                slope=slope,
                equivalent_load=float(summed_damage_load(ours, slope)),
                change=paired_change(ours, theirs),
                summed_change=summed_damage_change(ours, theirs, slope),
            )
            for slope, ours, theirs in zip(loads.slopes, loads.equivalent, reference.equivalent, strict=True)
        ),
        turbulence=None if alone is None or still is None else score_channel(alone, still),
    )


def split(
    total: ArrayLike, deterministic: ArrayLike, time_step: float, slopes: Sequence[float] = SLOPES
) -> Split:
    """All loads, and what is left of them without their deterministic part.

    Shear, tower shadow and gravity load a blade once a revolution whatever the flaps do. A flap may cancel some of
    that, which is no merit in turbulence: what is subtracted is the part with flaps at rest, under every agent the
    same, so that whatever a flap adds to it or takes from it counts as a load of its own in `turbulence`.

    Parameters
    ----------
    total : (..., T) array_like
        Load history under an agent.
    deterministic : (..., T) array_like
        The same with flaps at rest in steady wind, of the same azimuth.
    time_step : float
        Sampling time [s].
    slopes : sequence of float
        S-N slopes.

    Raises
    ------
    ValueError
        If the shapes differ, an entry is no finite number, or another argument is not positive.
    """
    whole = Numbers().check(total, "split.total")
    periodic = Numbers().check(deterministic, "split.deterministic")
    if whole.shape != periodic.shape:
        raise ValueError(
            f"split.deterministic: expected shape {whole.shape}, as of the total, got {periodic.shape}"
        )
    left = whole - periodic
    return Split(
        slopes=tuple(slopes),
        all_rms=root_mean_square(whole),
        turbulence_rms=root_mean_square(left),
        all_equivalent=_equivalent(whole, time_step, slopes),
        turbulence_equivalent=_equivalent(left, time_step, slopes),
    )


def _equivalent(series: Array, time_step: float, slopes: Sequence[float]) -> Array:
    """Damage-equivalent loads (slopes, ...) of series (..., T)."""
    TupleOf(Quantity("number", above=0.0)).check(slopes, "slopes")
    flat = series.reshape(-1, series.shape[-1])
    loads = np.array([damage_equivalent_loads(each, time_step, slopes) for each in flat])
    return loads.T.reshape(len(slopes), *series.shape[:-1])
