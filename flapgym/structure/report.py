"""The turbine's natural modes as text; the NREL 5 MW's beside what FAST, ADAMS and the paper give in Table 1."""

from __future__ import annotations

from flapgym.structure.modes import SECOND_DRIVETRAIN, is_published, modes_table, named_modes
from flapgym.turbine import Turbine

FIGURE_9 = 2.316  # Hz, the paper's second drivetrain torsion, 48 elements a blade


def describe_modes(turbine: Turbine, elements: int, rotor_speed: float = 0.0) -> str:
    """Table of natural frequencies: parked, beside those published of this turbine, or turning at a speed [rad/s]."""
    if rotor_speed == 0.0 and is_published(turbine):
        return _beside_table_1(turbine, elements)
    modes = named_modes(turbine, elements, rotor_speed)
    if rotor_speed:
        modes = sorted(modes, key=lambda mode: mode.frequency)
        state, seen = f"turning at {rotor_speed:.4f} rad/s", "mode seen from the tower"
    else:
        state, seen = "parked with blade 1 up", "mode"
    return "\n".join(
        [
            f"{turbine.name}, {state}, {elements} elements a blade; undamped, no wind",
            "",
            f"{seen:<36}{'Hz':>9}",
            *(f"{mode.name:<36}{mode.frequency:9.4f}" for mode in modes),
        ]
    )


def _beside_table_1(turbine: Turbine, elements: int) -> str:
    head = f"{turbine.name}, parked with blade 1 up, {elements} elements a blade; undamped, frequencies in Hz"
    lines = [
        head,
        "",
        f"{'mode':<36}{'here':>9}{'paper':>9}{'error':>9}{'FAST':>9}{'error':>9}{'ADAMS':>9}{'error':>9}",
    ]
    for row in modes_table(turbine, elements):
        cells = "".join(
            f"{row[source]:9.3f}{row['frequency'] / row[source] - 1.0:+9.2%}"
            for source in ("paper", "fast", "adams")
        )
        lines.append(f"{row['mode']:<36}{row['frequency']:9.4f}{cells}")
    second = next(mode for mode in named_modes(turbine, elements) if mode.name == SECOND_DRIVETRAIN)
    lines.append(
        f"{second.name:<36}{second.frequency:9.4f}   not in Table 1; the paper's Figure 9 labels it {FIGURE_9}"
    )
    return "\n".join(lines)
