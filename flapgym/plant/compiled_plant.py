"""The linear turbine stepped by compiled code: the plant wherever numba is installed."""

from __future__ import annotations

import contextlib
import inspect
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import event
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array, ComplexArray, FloatArray
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import compiled, layout
from flapgym.plant.actuator import Actuator
from flapgym.plant.compiled_loops import OPTIONS
from flapgym.plant.interface import Quick, Setup, Start, Task
from flapgym.plant.kernel import prepare
from flapgym.plant.lifted_plant import first_interval, first_motion
from flapgym.plant.responses import Responses
from flapgym.plant.sampled import fill_instant, plant_fingerprint
from flapgym.plant.stuck import first_modes


class _Announce(event.Listener):
    """Says so when code is compiled in earnest, not when it is read from the cache."""

    def __init__(self, precision: str, kept: bool) -> None:
        super().__init__()
        self.precision, self.kept, self.said = precision, kept, False

    def on_start(self, event: Any) -> None:
        if not self.said:
            once = (
                "once for this installation"
                if self.kept
                else "for this process alone, since no folder keeps it (name one in NUMBA_CACHE_DIR)"
            )
            sys.stderr.write(
                f"flapgym: compiling the plant's kernel in {self.precision}, {once} (ten to twenty seconds)\n"
            )
            sys.stderr.flush()
        self.said = True

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


RETURNED = types.Tuple((types.int64, types.float64, types.float64))
NO_SAMPLES = np.empty((0, 0, 0))
FLOAT32, FLOAT64 = np.dtype(np.float32), np.dtype(np.float64)


def load_kernel(precision: str, afresh: bool = False) -> tuple[Any, Any]:
    """Compile the kernel for a precision, or read it from the cache, so that no step has to wait.

    Parameters
    ----------
    precision : str
        Of the modes.
    afresh : bool
        Forget what is in the cache.

    Returns
    -------
    single, double : callable
        The compiled code for actions in single and in double precision. It is called past numba's look-up of types,
        which costs as much as a third of a step: who calls it sees to the types.
    """
    function = {"float64": compiled.advance_double, "float32": compiled.advance_single}[precision]
    announce, entries = _Announce(precision, function.stats.cache_path is not None), []
    if afresh:
        with event.install_listener("numba:compile", announce):
            function.recompile()
    for action in (types.float32, types.float64):
        arguments = (
            types.int64,
            # Strided and read-only arrays are actions too.
            types.Array(action, 1, "A", readonly=True),
            types.float32[::1],
            types.float64[::1],
        )
        with event.install_listener("numba:compile", announce):
            entries.append(compile_kept(function, RETURNED(*arguments)))
    return entries[0], entries[1]


def compile_kept(function: Any, signature: Any) -> Any:
    """Compiled code, made or read from the cache; what is damaged there is removed, and nothing there is needed."""
    try:
        return function.compile(signature)
    except Exception:
        # Numba unpickles what it kept, and of a file that is empty or cut comes any error.
        folder = function.stats.cache_path
        if folder is None:
            raise
        source = Path(inspect.getfile(function.py_func)).stem
        for kept in Path(folder).glob(f"{source}.{function.py_func.__qualname__}-*.nb?"):
            with contextlib.suppress(OSError):
                kept.unlink()
    try:
        return function.compile(signature)
    except OSError:  # the folder is gone since numba chose it
        return njit(**OPTIONS)(function.py_func).compile(signature)


class CompiledPlant:
    """n turbines by superposition: the flaps' response is stepped, the wind's is read from a table.

    Parameters
    ----------
    model : TurbineModel
    count : int
        Number of turbines n.
    setup : Setup
    task : Task
    """

    def __init__(self, model: TurbineModel, count: int, setup: Setup, task: Task) -> None:
        self._take_single, self._take_double = load_kernel(setup.precision)
        self.model, self.count, self.setup, self.task = model, count, setup, task
        self.fingerprint = plant_fingerprint(model)
        self._kernel = prepare(
            model, setup.steps_per_action, setup.length_scale, setup.every_sample, setup.single_blade
        )
        self._responses = Responses(self._kernel, count, setup, model.turbulence_intensity)
        self._batch = count >= layout.FEWEST_IN_BATCH
        self._groups = -(-self._kernel.flap.order // layout.LANES)
        self._size = 2 * self._groups * layout.LANES
        """Numbers of a turbine's modes, filled up."""
        self._real = self._modes_and_scratch()
        self._state = np.concatenate([self._head(), self._table(), np.zeros(count * layout.OWN)])
        self._handle = np.zeros(8, dtype=np.int64)
        self._locate()
        self._renew()

    def _renew(self) -> None:
        """Compile anew what was compiled from other files."""
        nothing = np.empty(0, np.float32), np.empty(0, np.float32), np.empty(0)
        if self._take_single(self._address, *nothing)[0] == compiled.OUTDATED:
            self._take_single, self._take_double = load_kernel(self.setup.precision, afresh=True)

    def _locate(self) -> None:
        """Note where the arrays are, for the compiled code."""
        arrays: tuple[FloatArray, ...] = (self._real, self._state, self._responses.rows, NO_SAMPLES)
        # In place: `quick` knows where this is.
        self._handle[:] = [number for array in arrays for number in (array.ctypes.data, array.size)]
        self._address = int(self._handle.ctypes.data)

    def __getstate__(self) -> dict[str, Any]:
        """A copy has its arrays elsewhere, and fetches the code itself."""
        here = ("_take_single", "_take_double", "_handle", "_address")
        return {name: value for name, value in self.__dict__.items() if name not in here}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._state[layout.LAYOUT] != compiled.EDITION:
            raise ValueError("plant: pickled by another version of flapgym; make the environment anew")
        self._real = aligned(self._real, self.setup.precision)
        self._take_single, self._take_double = load_kernel(self.setup.precision)
        self._handle = np.zeros(8, dtype=np.int64)
        self._locate()

    def _head(self) -> Array:
        model, setup, task, kernel = self.model, self.setup, self.task, self._kernel
        actuator = Actuator(
            model.flap_angle_limit,
            model.flap_rate_limit,
            model.time_step,
            setup.steps_per_action,
            setup.faults.lag,
        )
        head = np.zeros(layout.HEAD)
        for place, value in {
            layout.COUNT: self.count,
            layout.STEPS: setup.steps_per_action,
            layout.INTERVALS: setup.intervals,
            layout.MODES: kernel.flap.order,
            layout.BLADE_COUNT: setup.blades,
            layout.EVERY: setup.every_sample,
            layout.DISPLACED: setup.displacements or setup.every_sample or task.tower_weight > 0.0,
            layout.OBSERVED: task.size,
            layout.TIME_STEP: model.time_step,
            layout.TURN: kernel.turn,
            layout.COSINE_TURN: np.cos(kernel.turn),
            layout.SINE_TURN: np.sin(kernel.turn),
            layout.ANGLE_LIMIT: model.flap_angle_limit,
            layout.RATE_LIMIT: model.flap_rate_limit,
            layout.ACCELERATION_LIMIT: model.acceleration_limit,
            layout.LAG_DECAY: actuator.decay,
            layout.LAG_GAIN: actuator.gain,
            layout.WEIGHT_RBM: task.rbm_weight,
            layout.WEIGHT_ANGLE: task.angle_weight,
            layout.WEIGHT_TOWER: task.tower_weight,
            layout.LAYOUT: compiled.EDITION,
        }.items():
            head[place] = value
        head[layout.EFFECTIVENESS : layout.EFFECTIVENESS + 3] = setup.faults.effectiveness
        head[layout.STUCK : layout.STUCK + 3] = setup.faults.held
        return head

    def _table(self) -> Array:
        task = self.task
        return np.stack([task.columns, task.factors, task.bounds, task.noisy], axis=1).astype(float).ravel()

    def _modes_and_scratch(self) -> FloatArray:
        """Constants of the modes, the modes at rest, and room to work in."""
        lanes = layout.LANES if self._batch else 1
        rows, places = self._kernel.rows.count, -(-self.count // lanes) * lanes
        if self._batch:
            constants, feed = self._constants_of_batch()
            behind = [np.zeros((feed.size // rows + rows) * lanes), feed]
        else:
            constants, feed = self._constants_of_one()
            room = -(-len(self._kernel.held.feed) // layout.LANES) + 1 + -(-rows // layout.LANES)
            constants, behind = [*constants, feed], [np.zeros(room * layout.LANES)]
        self._first_mode = sum(part.size for part in constants)
        modes = np.zeros(self._size * places)
        return aligned(np.concatenate([*constants, modes, *behind]), self.setup.precision)

    def _constants_of_one(self) -> tuple[list[Array], Array]:
        """What the step of one turbine reads of the modes, and what it reads of the flaps."""
        held, flap, rows = self._kernel.held, self._kernel.flap, self._kernel.rows.count
        feed = np.zeros((len(held.feed) + BLADES, -(-rows // layout.LANES) * layout.LANES))
        # The outputs at the last sample are read behind the push.
        start, steps = np.split(held.feed, [layout.FLAP_INPUTS])
        feed[:, :rows] = np.vstack([start, held.held_feed - held.pushed, steps])
        reads = np.stack([flap.read.real, -flap.read.imag], axis=1)
        moments = np.vstack([flap.values.real, flap.values.imag, *reads[:BLADES]])
        others = np.zeros((layout.OTHERS, self._size))
        others[: len(reads) - BLADES, self._places] = (
            reads[BLADES:].transpose(0, 2, 1).reshape(-1, 2 * flap.order)
        )
        modes = [_with_drive(flap.values, held.step), _with_drive(held.decay, held.push), moments]
        return [*(self._grouped(each) for each in modes), others.ravel()], feed.ravel()

    def _constants_of_batch(self) -> tuple[list[Array], Array]:
        """The same for turbines side by side."""
        held, flap, k = self._kernel.held, self._kernel.flap, self.setup.steps_per_action
        order, rows, size = flap.order, self._kernel.rows.count, self._size
        decay, push = np.zeros((size // 2, 2)), np.zeros((size // 2, 2, 2, k, BLADES))
        powers = flap.values[:, None] ** np.arange(k - 1, -1, -1)
        by_step = (powers[:, :, None] * held.step[:, None]).reshape(order, k, 2, BLADES)
        decay[:order] = _parts(held.decay)
        push[:order] = _parts(by_step).transpose(0, 4, 2, 1, 3)
        reading = np.zeros((rows, size))
        reading[:, : 2 * order] = held.read.T
        start, steps = np.split(held.feed, [layout.FLAP_INPUTS])
        steps = steps.reshape(k, 2, BLADES, rows).swapaxes(0, 1).reshape(-1, rows)
        feed = np.ascontiguousarray(np.vstack([start, steps]).T)
        return [part.ravel() for part in (decay, push, reading)], feed.ravel()

    def _grouped(self, rows: Array) -> Array:
        """Numbers of the modes, (rows, modes), group by group, filled up with zeros."""
        room = np.zeros((rows.shape[0], self._groups * layout.LANES))
        room[:, : rows.shape[1]] = rows
        return room.reshape(-1, self._groups, layout.LANES).transpose(1, 0, 2).ravel()

    @property
    def _places(self) -> NDArray[np.int64]:
        """(2 modes,) where real and imaginary part of each mode, in turn, stand among a turbine's numbers."""
        modes = np.arange(self._kernel.flap.order)
        if self._batch:
            return np.arange(2 * modes.size)
        group, lane = np.divmod(modes, layout.LANES)
        first = 2 * group * layout.LANES + lane
        return np.stack([first, first + layout.LANES], axis=1).ravel()

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self._kernel.disturbance.noise_count(self.setup.intervals)

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """Intervals done since each turbine's reset, (n,)."""
        return self._own[:, layout.OWN_ELAPSED].astype(np.int64)

    @property
    def _own(self) -> Array:
        """Records (n, OWN) of the turbines, a view."""
        start = layout.HEAD + layout.ENTRY * self.task.size
        return self._state[start : start + self.count * layout.OWN].reshape(self.count, layout.OWN)

    def _modes(self, turbine: int) -> FloatArray:
        """Modes of a turbine, (size,), a view; they are shifted, as flapgym.plant.held has them."""
        lanes, size = layout.LANES if self._batch else 1, self._size
        block, lane = divmod(turbine, lanes)
        start = self._first_mode + block * size * lanes
        return self._real[start : start + size * lanes].reshape(size, lanes)[:, lane]

    def reset(self, turbines: NDArray[np.int64], start: Start) -> tuple[NDArray[np.float32], Array]:
        """Begin an episode of m turbines; observations (m, observed) and rows (m, ROW) of sample 0."""
        setup, start = self.setup, start.under(self.setup.faults)
        first = self._responses.draw(turbines, start)
        still = not (start.flap_angle.any() or start.flap_rate.any())
        for turbine in turbines if still else ():
            self._modes(int(turbine))[...] = 0.0
        if not still:
            effectiveness = np.array(setup.faults.effectiveness)[: setup.blades]
            motion = first_motion(start, effectiveness)
            modes = first_modes(self._kernel.flap, setup, start.azimuth, self._kernel.turn)
            first[:, :8] += (modes @ self._kernel.flap.read.T).real + motion @ self._kernel.direct
            modes = modes + motion @ self._kernel.held.shift.T
            for turbine, own_modes in zip(turbines, modes, strict=True):
                self._modes(int(turbine))[self._places] = own_modes.view(float)
        own = np.zeros((len(turbines), layout.OWN))
        own[:, layout.OWN_ANGLE : layout.OWN_ANGLE + setup.blades] = start.flap_angle[:, : setup.blades]
        own[:, layout.OWN_RATE : layout.OWN_RATE + setup.blades] = start.flap_rate[:, : setup.blades]
        own[:, layout.OWN_AZIMUTH] = start.azimuth
        own[:, layout.OWN_LEVEL] = self._responses.level[turbines]
        own[:, layout.OWN_RESPONSE] = self._responses.place[turbines]
        self._own[turbines] = own
        noise = start.measurement_noise
        if noise is not None:
            self._keep_noise(turbines, noise)
        rows = np.zeros((len(turbines), layout.ROW))
        fill_instant(rows, first_interval(first, start, setup.blades), start.azimuth)
        return self.task.observe(rows, None if noise is None else noise[:, 0]), rows

    def _keep_noise(self, turbines: NDArray[np.int64], noise: Array) -> None:
        """Put measurement noise behind the records, where there is none yet make room."""
        size = self.count * noise[0].size
        if self._state[layout.NOISY] == 0.0:
            self._state = np.concatenate([self._state, np.zeros(size)])
            self._state[layout.NOISY] = 1.0
            self._locate()
        self._state[-size:].reshape(self.count, -1)[turbines] = noise.reshape(len(turbines), -1)

    def step(
        self,
        actions: FloatArray,
        observation: NDArray[np.float32],
        rows: Array,
        samples: Array | None = None,
    ) -> int:
        """Hold actions (n blades,) for k plant steps; see flapgym.plant.interface.Plant."""
        # The very objects, as of every plain array; of another byte order, say, it is another object.
        kind = actions.dtype if actions.__class__ is np.ndarray and actions.ndim == 1 else None
        if kind is not FLOAT32 and kind is not FLOAT64:
            raise TypeError("actions: expected a flat array of floats")
        for name, array, dtype in (("observation", observation, FLOAT32), ("rows", rows, FLOAT64)):
            if not (array.dtype is dtype and array.ndim == 1 and array.flags.carray):
                raise TypeError(f"{name}: expected a flat, contiguous, writeable array of {dtype}")
        take = self._take_single if kind is FLOAT32 else self._take_double
        if samples is None:
            return take(self._address, actions, observation, rows)[0]
        if not (samples.dtype is FLOAT64 and samples.flags.carray):
            raise TypeError(f"samples: expected a contiguous, writeable array of {FLOAT64}")
        self._handle[-2:] = samples.ctypes.data, samples.size
        try:
            return take(self._address, actions, observation, rows)[0]
        finally:
            self._handle[-1] = 0

    @property
    def quick(self) -> Quick:
        """`step` for flat float32 arrays and without samples, at the least cost of a call."""
        return self._take_single, self._address

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        own = self._own[turbine]
        return {
            "elapsed": int(own[layout.OWN_ELAPSED]),
            "flaps": own[: layout.OWN_TRAVEL].reshape(3, 3)[:, : self.setup.blades].tolist(),
            "travel": own[layout.OWN_TRAVEL : layout.OWN_TRAVEL + 3].tolist(),
            "modes": self._modes(turbine)[self._places].astype(float).tolist(),
        }

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        own, blades = self._own[turbine], self.setup.blades
        own[layout.OWN_ELAPSED] = state["elapsed"]
        own[: layout.OWN_TRAVEL].reshape(3, 3)[:, :blades] = state["flaps"]
        own[layout.OWN_TRAVEL : layout.OWN_TRAVEL + 3] = state["travel"]
        self._modes(turbine)[self._places] = state["modes"]


def aligned(numbers: FloatArray, precision: str) -> FloatArray:
    """A copy that begins at a multiple of ALIGNMENT bytes."""
    dtype = np.dtype(precision)
    room = np.empty(numbers.size + layout.ALIGNMENT // dtype.itemsize, dtype=dtype)
    skipped = (-room.ctypes.data % layout.ALIGNMENT) // dtype.itemsize
    room[skipped : skipped + numbers.size] = numbers
    return room[skipped : skipped + numbers.size]


def _with_drive(values: ComplexArray, drive: ComplexArray) -> Array:
    """Rows of a group's constants: eigenvalue, inputs to the real part, inputs to the imaginary part."""
    return np.vstack([values.real, values.imag, drive.real.T, drive.imag.T])


def _parts(numbers: ComplexArray) -> Array:
    """Real and imaginary part, along a last axis of two."""
    return np.stack([numbers.real, numbers.imag], axis=-1)
