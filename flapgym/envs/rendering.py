"""The picture of a running turbine: the rotor seen from upwind with its flaps, and rolling traces beside it.

Drawn with pygame, loaded only when an environment is made with a render mode.
"""

from __future__ import annotations

import textwrap
from collections import deque
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from flapgym.envs.disk import SHOWN_DEVIATIONS, EpisodeWind, Raster, wind_colours
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import TurbineModel

WIDTH, HEIGHT = 640, 480
SPAN = 20.0
"""Length of the traces [s]."""
FRAME = 0.035
"""Time between the points of a trace and the pictures in a window [s]; shorter actions are passed over."""

Colour = tuple[int, int, int]
Point = tuple[float, float]

PAPER: Colour = (250, 250, 248)
INK: Colour = (45, 45, 50)
GREY: Colour = (205, 205, 205)
FAINT: Colour = (232, 232, 232)
BLADE: Colour = (150, 155, 160)
BLADE_COLOURS: tuple[Colour, ...] = ((0, 114, 178), (213, 94, 0), (0, 140, 100))
WIND: Colour = (90, 90, 95)

SHOWN = ("rbm", "flap_angle", "flap_rate", "wind_perturbation", "azimuth")
"""What of an environment's `info` is drawn."""
HUB: Point = (150.0, 175.0)
REACH = 125.0
"""Rotor radius on the screen [pixels]."""
BLADE_SPAN = (0.02, 1.0)
"""Ends of the drawn blade over the rotor radius; its chords, and the flaps', are symbols and no blade's own."""
WIDEST = 0.2
"""Where the drawn blade is widest, over the rotor radius."""
SCALE_PLACE, SCALE_WIDTH = (20, 338), 90
"""Of the colours of the wind [pixels]: left of the tower, below the disk."""


class Screen:
    """Keeps the last seconds of an episode and draws them.

    Parameters
    ----------
    model : TurbineModel
    mode : str
        "rgb_array" or "human".
    period : float
        Time between frames [s].
    blowing : callable
        Makes the wind over the disk in the episode that runs, None where it is the same all over.
    """

    def __init__(
        self, model: TurbineModel, mode: str, period: float, blowing: Callable[[], EpisodeWind | None]
    ) -> None:
        self.model, self._mode, self._period = model, mode, period
        self._blowing = blowing
        self._wind: EpisodeWind | None = None
        self._wind_known = False
        """Whether this episode's has been asked for."""
        plate = nameplate(model.case)
        self._rotor_radius = plate.rotor_radius
        flaps, spans = len(model.flaps), plate.flap_spans
        # A model that does not tell where its flaps are shows their angles along the whole blade, side by side.
        ends = np.linspace(*BLADE_SPAN, flaps + 1)
        self._spans = spans if len(spans) == flaps else tuple(pairwise(ends))
        self._angle_limit = max(flap.angle_limit for flap in model.flaps)
        self._every = max(1, round(FRAME / period))
        self._history: deque[dict[str, Any]] = deque(maxlen=int(SPAN / (self._every * period)) + 1)
        self._now: dict[str, Any] | None = None
        self._elapsed = 0
        self._open()

    def _open(self) -> None:
        try:
            import pygame
        except ImportError as error:
            raise DependencyNotInstalled('rendering needs pygame: pip install "flapgym[render]"') from error
        self._pygame: Any = pygame
        pygame.font.init()
        self._fonts = {size: pygame.font.Font(None, size) for size in (16, 20)}
        self._canvas = pygame.Surface((WIDTH, HEIGHT))
        self._window: Any = None
        self._clock: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy draws on a canvas of its own; a window stays with the original."""
        here = ("_pygame", "_fonts", "_canvas", "_window", "_clock")
        return {name: value for name, value in self.__dict__.items() if name not in here}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._open()

    def clear(self) -> None:
        """Forget the traces: a new episode begins."""
        self.resume(None, -1)

    def resume(self, now: dict[str, Any] | None, elapsed: int) -> None:
        """Forget the traces and go on from an instant, of which flap angles and azimuth are enough.

        Parameters
        ----------
        now : dict or None
            Entries of an environment's `info`; None where there is nothing to show.
        elapsed : int
            Frames since the episode's start.
        """
        self._history.clear()
        self._now, self._elapsed = now, elapsed
        self._wind, self._wind_known = None, False

    def record(self, info: dict[str, Any]) -> None:
        """Add one instant, an environment's `info`."""
        self._elapsed += 1
        self._now = info
        if self._elapsed % self._every == 0:
            self._history.append(info)

    def picture(self) -> NDArray[np.uint8]:
        """The frame as (height, width, 3)."""
        self._draw()
        return np.ascontiguousarray(self._pygame.surfarray.array3d(self._canvas).transpose(1, 0, 2))

    def display(self) -> None:
        """Show the frame in a window, no faster than real time."""
        if self._elapsed % self._every != 0:
            return
        pygame = self._pygame
        if self._window is None:
            pygame.display.init()
            pygame.display.set_caption("flapgym")
            self._window = pygame.display.set_mode((WIDTH, HEIGHT))
            self._clock = pygame.time.Clock()
        self._draw()
        self._window.blit(self._canvas, (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(1.0 / (self._every * self._period))

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None

    def _draw(self) -> None:
        self._canvas.fill(PAPER)
        if self._now is None:
            return
        now = self._now
        limit = np.rad2deg(self._angle_limit)
        self._rotor(now)
        self._text(
            "rotor from upwind" if "azimuth" in now else "clamped blade from upwind", (20, 14), 16, WIND
        )
        self._text(f"t {self._elapsed * self._period:6.2f} s", (20, 430), 20)
        if "azimuth" in now:
            self._text(f"azimuth {round(np.rad2deg(now['azimuth'])) % 360:5d} deg", (120, 430), 20)
        if "wind_perturbation" in now:
            self._text(f"wind {self.model.wind_speed + now['wind_perturbation']:5.2f} m/s", (20, 452), 20)
        for blade, (angles, colour) in enumerate(zip(self._by_blade(now), BLADE_COLOURS, strict=False)):
            self._text(_angles_text(blade + 1, np.rad2deg(angles)), (20 + 92 * blade, 405), 16, colour)
        rbm = np.array([entry["rbm"] for entry in self._history]) * 1e-6
        flap = np.rad2deg([entry["flap_angle"] for entry in self._history])
        wind = np.array([[entry["wind_perturbation"]] for entry in self._history])
        reach = max(3.0 * self.model.rbm_rms * 1e-6, float(np.abs(rbm).max(initial=0.0)))
        self._trace((345, 30), "root bending moment [MN m]", rbm, reach, BLADE_COLOURS)
        of_flaps = [colour for colour in BLADE_COLOURS for _ in self.model.flaps]
        self._trace((345, 180), "flap angle [deg]", flap, 1.15 * float(limit), of_flaps)
        self._trace(
            (345, 330),
            "wind perturbation [m/s]",
            wind,
            max(
                3.0 * self.model.turbulence_intensity * self.model.wind_speed,
                float(np.abs(wind).max(initial=0.0)),
            ),
            (WIND,),
        )
        for seconds in range(0, int(SPAN) + 1, 5):
            self._text(f"{seconds - SPAN:.0f}", (338 + 14 * seconds, 445), 16, WIND)
        self._text("time [s]", (464, 460), 16, WIND)

    def _over_disk(self) -> EpisodeWind | None:
        """The wind over the disk in this episode, made when it is first drawn."""
        if not self._wind_known:
            self._wind, self._wind_known = self._blowing(), True
        return self._wind

    def _disk(self, wind: EpisodeWind) -> None:
        """The wind at this moment by colour, and the scale of it beside the tower."""
        assert self._rotor_radius is not None  # a field takes a case that tells it
        reach = round(REACH)
        raster = _raster(tuple(wind.field.radii.tolist()), self._rotor_radius, reach)
        most = SHOWN_DEVIATIONS * wind.deviation
        left, top = round(HUB[0]) - reach, round(HUB[1]) - reach
        pixels = self._pygame.surfarray.pixels3d(self._canvas)
        around = pixels[left : left + 2 * reach + 1, top : top + 2 * reach + 1]
        around[raster.inside] = wind_colours(raster.values(wind.at(self._elapsed)) / most)
        bar = np.linspace(-1.0, 1.0, SCALE_WIDTH)
        x, y = SCALE_PLACE
        pixels[x : x + SCALE_WIDTH, y : y + 8] = wind_colours(bar)[:, None]
        del pixels, around  # they lock the canvas
        self._pygame.draw.rect(self._canvas, GREY, (x, y, SCALE_WIDTH, 8), 1)
        for share, label in ((0.0, f"{-most:.2g}"), (0.5, "0"), (0.9, f"{most:+.2g}")):
            self._text(label, (x + share * SCALE_WIDTH, y + 10), 16, WIND)
        self._text("wind by colour [m/s]", (x, y - 14), 16)
        for line, parts in enumerate(textwrap.wrap(wind.parts, 25)):
            self._text(parts, (165, y - 14 + 12 * line), 16)

    def _rotor(self, now: dict[str, Any]) -> None:
        """Tower, blades and flaps; seen from upwind the rotor turns clockwise."""
        draw = self._pygame.draw
        wind = self._over_disk()
        if "azimuth" in now:
            foot = [(HUB[0] - 3, HUB[1]), (HUB[0] + 3, HUB[1]), (HUB[0] + 6, 362), (HUB[0] - 6, 362)]
            draw.polygon(self._canvas, GREY, foot)
            if wind is not None:
                self._disk(wind)
                draw.polygon(self._canvas, GREY, foot, 1)
            draw.circle(self._canvas, GREY, HUB, REACH, 1)
        for blade, (angles, colour) in enumerate(zip(self._by_blade(now), BLADE_COLOURS, strict=False)):
            azimuth = now.get("azimuth", 0.0) + 2.0 * np.pi * blade / 3.0
            root, tip = BLADE_SPAN
            forward = [(root, 3.0), (WIDEST, 5.0), (tip, 1.5)]
            outline = [*forward, *((radius, _trailing_edge(radius)) for radius in (tip, WIDEST, root))]
            outline = [_place(azimuth, *corner) for corner in outline]
            draw.polygon(self._canvas, BLADE, outline)
            if wind is not None:
                draw.polygon(self._canvas, INK, outline, 1)
            for angle, span in zip(angles, self._spans, strict=True):
                corners = [_place(azimuth, *corner) for corner in flap_outline(*span)]
                draw.polygon(self._canvas, _flap_colour(angle / self._angle_limit), corners)
                draw.polygon(self._canvas, INK, corners, 1)
            label = _place(azimuth, 1.09, 0.0)
            self._text(str(blade + 1), (label[0] - 4, label[1] - 7), 20, colour)
        draw.circle(self._canvas, INK, HUB, 6)
        self._legend()

    def _by_blade(self, now: dict[str, Any]) -> NDArray[np.float64]:
        """Flap angles of an instant, (blades, F) [rad]."""
        return np.asarray(now["flap_angle"], dtype=np.float64).reshape(-1, len(self.model.flaps))

    def _legend(self) -> None:
        limit = np.rad2deg(self._angle_limit)
        for step in range(101):
            colour = _flap_colour(step / 50.0 - 1.0)
            self._pygame.draw.line(self._canvas, colour, (100 + step, 376), (100 + step, 386))
        self._text(f"flap {-limit:.3g}", (50, 375), 16)
        self._text(f"{limit:+.3g} deg (lift up)", (208, 375), 16)

    def _trace(
        self,
        corner: tuple[int, int],
        title: str,
        values: NDArray[np.float64],
        reach: float,
        colours: Sequence[Colour],
    ) -> None:
        """One panel with a line per column of values (t, lines), from -reach to reach."""
        draw = self._pygame.draw
        left, top, width, height = *corner, 280, 110
        self._text(title, (left, top - 16), 16)
        draw.rect(self._canvas, (255, 255, 255), (left, top, width, height))
        for tick in range(1, 4):
            draw.line(
                self._canvas, FAINT, (left + width * tick / 4, top), (left + width * tick / 4, top + height)
            )
        step = _round_step(reach)
        for level in np.arange(-np.floor(reach / step), np.floor(reach / step) + 1) * step:
            y = top + height * (0.5 - 0.5 * level / reach)
            draw.line(self._canvas, GREY, (left, y), (left + width, y))
            self._text(f"{level:g}", (left - 26, y - 5), 16, WIND)
        if len(values) > 1:
            # The newest at the right edge, as the axis says.
            x = left + width * (1.0 - np.arange(len(values))[::-1] / (SPAN / (self._every * self._period)))
            y = top + height * (0.5 - 0.5 * np.clip(values / reach, -1.0, 1.0))
            for line, colour in zip(range(y.shape[1]), colours, strict=False):
                draw.aalines(self._canvas, colour, False, np.stack([x, y[:, line]], axis=1))
        draw.rect(self._canvas, INK, (left, top, width, height), 1)

    def _text(self, text: str, place: Point, size: int, colour: Colour = INK) -> None:
        self._canvas.blit(self._fonts[size].render(text, True, colour), place)


@lru_cache(maxsize=4)
def _raster(radii: tuple[float, ...], rotor_radius: float, reach: int) -> Raster:
    return Raster.of(np.array(radii), rotor_radius, reach)


def _angles_text(blade: int, degrees: NDArray[np.float64]) -> str:
    """A blade's flap angle in words; of several flaps the least and the largest."""
    if len(degrees) == 1:
        return f"flap {blade}  {degrees[0]:+5.1f} deg"
    return f"{blade}  {degrees.min():+.0f} to {degrees.max():+.0f} deg"


def flap_outline(inner: float, outer: float) -> list[Point]:
    """Corners (over the rotor radius, pixels forward) of a flap between two radii: some pixels behind the blade."""
    inside = [radius for radius in (WIDEST,) if inner < radius < outer]
    behind = [(radius, _trailing_edge(radius) - 5.5) for radius in (outer, *inside, inner)]
    return [(inner, -1.0), (outer, -1.0), *behind]


def _trailing_edge(radius: float) -> float:
    """Pixels forward at which the drawn blade ends, at a fraction of the rotor radius."""
    return float(np.interp(radius, (BLADE_SPAN[0], WIDEST, BLADE_SPAN[1]), (-3.0, -13.0, -2.5)))


def _place(azimuth: float, radius: float, forward: float) -> Point:
    """Screen point at a fraction of the rotor radius, `forward` pixels toward the leading edge."""
    s, c = float(np.sin(azimuth)), float(np.cos(azimuth))
    return HUB[0] + REACH * radius * s + forward * c, HUB[1] - REACH * radius * c + forward * s


def _flap_colour(fraction: float) -> Colour:
    """Blue (-1, lift down) over white to red (+1, lift up)."""
    strength = min(abs(float(fraction)), 1.0)
    end = (200, 40, 40) if fraction > 0.0 else (40, 80, 200)
    return tuple(round(255 + strength * (part - 255)) for part in end)  # type: ignore[return-value]


def _round_step(reach: float) -> float:
    """A step of 1, 2 or 5 times a power of ten with one to three lines on each side of zero."""
    power = 10.0 ** np.floor(np.log10(reach))
    return float(
        next(power * factor for factor in (0.2, 0.5, 1.0, 2.0, 5.0) if reach / (power * factor) < 4.0)
    )
