"""What a model file says of its own making: the readings behind it, the tools, its errors, its flutter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from flapgym.turbine import Case

MARGIN = 1.3
"""Flutter below this many times the operating speed is worth a warning."""


def readings(case: Case) -> tuple[str, ...]:
    """Where the sources are silent or short: what a case reads into them, in a line each."""
    loads, turbine = case.airloads, case.turbine
    axis, wake = loads.elastic_axis, loads.mean_wake
    return (
        f"shaft bends with EI {turbine.drivetrain.shaft_bending_stiffness:g} N m^2, generator locked, inertia of the "
        f"nacelle about its roll axis {turbine.nacelle.roll_inertia:g} kg m^2",
        f"structural damping is modal: {turbine.blade_damping_ratio:.3%} of critical for every mode of a blade, "
        f"{turbine.tower_damping_ratio:.3%} for tower and shaft",
        "the blade's beam axis runs through "
        + ("its pitch axis, by station" if axis == "published" else f"{axis:.1%} of the chords"),
        "mean wind and gust along the tilted shaft; the perturbations' wake moves with the mean wind less the case's "
        "induction",
        "mean load: "
        + ("no profile drag, " if loads.profile == "none" else "the sections' drag and pitching moment, ")
        + (
            "the perturbations' wake"
            if wake == "perturbations"
            else f"a wake of {wake:g} diameters with induction"
        ),
        "perturbations: lift slope "
        + ("2 pi" if loads.lift_slope == "thin aerofoil" else "listed with the sections' polars")
        + "; no change of drag and pitching moment, no dynamic stall",
        "forces are those of the perturbed circulation in the mean flow"
        + (
            ""
            if loads.linearisation == "mean flow"
            else ", and of the mean circulation in the perturbed flow"
        ),
        "the perturbations' wake is a fixed helix"
        + (
            ""
            if loads.slow_wake == "frozen"
            else "; in the whole turbine slow wind and collective flaps have a state each for a longer one, which moves"
        ),
        "root moment about the in-plane axis of the coned, untwisted blade; tip deflection normal to the coned blade",
        *(
            (
                "pitch turns the bent blade rigidly, mean induced velocities along with it"
                + (
                    "; it has no slow wake state"
                    if loads.slow_wake == "frozen"
                    else "; collective pitch has a state for a longer wake, whose induction follows the thrust"
                ),
            )
            if case.signals.pitch
            else ()
        ),
        (
            "gravity is an input, on arms that do not change with deflection; perturbations about a trim without it"
            if case.signals.gravity
            else "gravity left out; perturbations about the trim under the mean air and centrifugal load"
        ),
    )


@dataclass(frozen=True)
class Flutter:
    """Result of a search for flutter, speeds over the operating rotor speed.

    Attributes
    ----------
    searched : float
        Speed up to which the blade was looked at; less than asked where it finds no equilibrium beyond.
    speed, frequency : float or None
        Lowest speed found at which the spectral radius passes one, and the frequency at which the blade then
        oscillates, seen from the rotor [Hz]; None if there is none.
    """

    searched: float
    speed: float | None = None
    frequency: float | None = None

    def describe(self) -> str:
        """In one line, with a warning where it is near."""
        if self.speed is None:
            return f"none of the unloaded, clamped blade up to {self.searched:.2f} times the rotor speed"
        where = f"at {self.speed:.2f} times the rotor speed, {self.frequency:.2f} Hz"
        warning = f"; WARNING: less than {MARGIN:g} times it" if self.speed < MARGIN else ""
        return f"of the unloaded, clamped blade {where}{warning}"


@dataclass(frozen=True)
class Record:
    """How a model was made.

    Attributes
    ----------
    tools : mapping
        Versions of flapgym, numpy and scipy that built it, for information.
    readings : tuple of str
        Where the paper is silent, what was read into it.
    errors : mapping
        Error of each conversion on the way, by name, relative to what it converts.
    flutter : Flutter, optional
        Of the rotating blade; None if it was not looked for.
    """

    tools: Mapping[str, str] = field(default_factory=dict)
    readings: tuple[str, ...] = ()
    errors: Mapping[str, float] = field(default_factory=dict)
    flutter: Flutter | None = None
