"""Names of a model's inputs and outputs: which there are, in which order, and what belongs to the blades.

A quantity that every blade has comes as three signals, in multi-blade coordinates ``name_0, name_c, name_s`` or blade
by blade ``name_1, name_2, name_3``; one of the wind or the tower as ``name`` alone.
"""

from __future__ import annotations

from collections.abc import Sequence

COMPONENTS = ("0", "c", "s")
"""Multi-blade coordinates, as names end."""
EACH_BLADE = ("1", "2", "3")
BLADE_OUTPUTS = ("rbm", "tip_deflection")
"""What every model tells of its blades, and all that one of the clamped blade does."""
FIXED_OUTPUTS = ("tower_fore_aft", "tower_side_side")
GRAVITY = "gravity"
GENERATOR_TORQUE = "generator_torque"
INDUCED_WIND = "induced_wind"
"""What a wake that gives way to rotor speed makes of the wind at the blades."""
PITCH_KINDS = ("angle", "rate", "acceleration")


def flap_names(count: int) -> tuple[str, ...]:
    """Of ``count`` flaps a blade, from root to tip: "flap" where there is one, else "flap1", "flap2" and so on."""
    return ("flap",) if count == 1 else tuple(f"flap{number}" for number in range(1, count + 1))


def blade_flap_inputs(count: int) -> tuple[str, ...]:
    """The 2 F inputs of one blade of F flaps: all angles [rad], then all rates [rad/s]."""
    return tuple(f"{flap}_{kind}" for kind in ("angle", "rate") for flap in flap_names(count))


def blade_inputs(flaps: int) -> tuple[str, ...]:
    """Inputs of the clamped blade: its flaps, then the homogeneous wind."""
    return (*blade_flap_inputs(flaps), "wind")


def flap_inputs(count: int, parts: Sequence[str] = COMPONENTS) -> tuple[str, ...]:
    """The 6 F inputs of a turbine of F flaps a blade: all angles flap by flap, then all rates."""
    return _each(blade_flap_inputs(count), parts)


def strip_inputs(strips: int, parts: Sequence[str] = COMPONENTS) -> tuple[str, ...]:
    """The wind in each of a blade's strips, from root to tip."""
    return _each([f"wind{strip}" for strip in range(1, strips + 1)], parts)


def pitch_inputs(parts: Sequence[str] = COMPONENTS) -> tuple[str, ...]:
    """Pitch of each blade: angles [rad], rates [rad/s] and accelerations [rad/s^2]."""
    return _each([f"pitch_{kind}" for kind in PITCH_KINDS], parts)


def turbine_inputs(
    flaps: int,
    strips: int = 0,
    parts: Sequence[str] = COMPONENTS,
    *,
    pitch: bool = False,
    gravity: bool = False,
) -> tuple[str, ...]:
    """Inputs of a turbine: flaps and homogeneous wind, then what its case asks for: winds by strip, pitch, gravity."""
    own = (*flap_inputs(flaps, parts), "wind", *strip_inputs(strips, parts))
    return own + (pitch_inputs(parts) if pitch else ()) + ((GRAVITY,) if gravity else ())


def turbine_outputs(
    further: Sequence[tuple[str, bool]] = (), parts: Sequence[str] = COMPONENTS
) -> tuple[str, ...]:
    """Outputs of a turbine: those of every model, then ``further`` ones, each with whether it is the blades'."""
    own = (*_each(BLADE_OUTPUTS, parts), *FIXED_OUTPUTS)
    return own + tuple(
        name for base, of_blades in further for name in (_each([base], parts) if of_blades else (base,))
    )


def grouped(names: Sequence[str], parts: Sequence[str] = COMPONENTS) -> list[tuple[str, bool]]:
    """Signals in order, three of the blades as one without their ends; each with whether it is the blades'."""
    found, at = [], 0
    while at < len(names):
        base = names[at].removesuffix(f"_{parts[0]}")
        of_blades = tuple(names[at : at + 3]) == _each([base], parts)
        found.append((base if of_blades else names[at], of_blades))
        at += 3 if of_blades else 1
    return found


def _each(names: Sequence[str], parts: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{name}_{part}" for name in names for part in parts)
