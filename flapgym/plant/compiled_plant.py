"""The linear turbine stepped by compiled code: the plant wherever numba is installed."""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

import numpy as np
from numba import types
from numba.core import event
from numpy.typing import NDArray

from flapgym.aeroelastic.model import TurbineModel
from flapgym.plant import compiled, layout
from flapgym.plant.actuator import Actuator
from flapgym.plant.interface import FloatArray, Quick, Setup, Start, Task
from flapgym.plant.kernel import Kernel, prepare
from flapgym.plant.lifted_plant import first_feedthrough, first_interval
from flapgym.plant.responses import Responses
from flapgym.plant.sampled import fill_instant, plant_fingerprint
from flapgym.plant.stuck import first_modes
from flapgym.state_space import Array


class _Announce(event.Listener):
    """Says so when code is compiled in earnest, not when it is read from the cache."""

    def __init__(self, precision: str) -> None:
        super().__init__()
        self.precision, self.said = precision, False

    def on_start(self, event: Any) -> None:
        if not self.said:
            sys.stderr.write(
                f"flapgym: compiling the plant's kernel in {self.precision}, once for this installation "
                "(some ten seconds)\n"
            )
            sys.stderr.flush()
        self.said = True

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


RETURNED = types.Tuple((types.int64, types.float64, types.float64, types.float64))
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
    if afresh:
        function._cache.flush()
        function._reset_overloads()
    announce, entries = _Announce(precision), []
    for action in (types.float32, types.float64):
        arguments = (
            types.int64,
            # Strided and read-only arrays are actions too.
            types.Array(action, 1, "A", readonly=True),
            types.float32[::1],
            types.float64[::1],
        )
        if arguments not in function.overloads:
            with event.install_listener("numba:compile", announce):
                function.compile(RETURNED(*arguments))
        entries.append(function.overloads[arguments].entry_point)
    return entries[0], entries[1]


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
        self._groups = -(-self._kernel.flap.order // layout.GROUP)
        self._real = self._modes_and_scratch()
        self._state = np.concatenate([self._head(), self._table(), np.zeros(count * layout.OWN)])
        self._handle = np.zeros(8, dtype=np.int64)
        self._locate()
        nothing = np.empty(0, np.float32), np.empty(0, np.float32), np.empty(0)
        if self.quick(*nothing)[0] == compiled.OUTDATED:
            self._take_single, self._take_double = load_kernel(setup.precision, afresh=True)

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
            layout.MODES: 2 * -(-self._kernel.flap.order // 2),
            layout.BLADE_COUNT: setup.blades,
            layout.EVERY: setup.every_sample,
            layout.DISPLACED: setup.displacements or setup.every_sample,
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
        head[layout.DIRECT :] = kernel.flap.D.ravel()
        return head

    def _table(self) -> Array:
        task = self.task
        return np.stack([task.columns, task.factors, task.bounds, task.noisy], axis=1).astype(float).ravel()

    def _modes_and_scratch(self) -> FloatArray:
        """Constants of the modes in groups, the modes at rest, and room to work in."""
        lanes = layout.LANES if self._batch else 1
        k, places = self.setup.steps_per_action, -(-self.count // lanes) * lanes
        room = 2 * self._groups * layout.GROUP * places
        inputs = (k + 1) * layout.FLAP_INPUTS + 8 * k
        scratch = inputs * lanes + 8 * k * layout.GROUP
        constants = mode_constants(self._kernel, self._groups)
        return aligned(np.concatenate([constants.ravel(), np.zeros(room + scratch)]), self.setup.precision)

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
        """Modes (groups, 2, GROUP) of a turbine, a view: real parts of a group, then imaginary ones."""
        start = layout.CONSTANTS * layout.GROUP * self._groups
        size = 2 * self._groups * layout.GROUP
        if not self._batch:
            own = self._real[start + turbine * size : start + (turbine + 1) * size]
            return own.reshape(self._groups, 2, layout.GROUP)
        block, lane = divmod(turbine, layout.LANES)
        rows = self._real[start + block * size * layout.LANES : start + (block + 1) * size * layout.LANES]
        split = rows.reshape(self._groups, layout.GROUP, 2, layout.LANES)[:, :, :, lane]
        return split.transpose(0, 2, 1)

    def reset(self, turbines: NDArray[np.int64], start: Start) -> tuple[NDArray[np.float32], Array]:
        """Begin an episode of m turbines; observations (m, observed) and rows (m, ROW) of sample 0."""
        setup, start = self.setup, start.under(self.setup.faults)
        first = self._responses.draw(turbines, start)
        for turbine in turbines:
            self._modes(int(turbine))[...] = 0.0
        if setup.faults.held_angle.any():
            modes = first_modes(self._kernel.flap, setup, start.azimuth, self._kernel.turn)
            first[:, :8] += (modes @ self._kernel.flap.read.T).real
            grouped = np.zeros((len(turbines), self._groups * layout.GROUP), dtype=complex)
            grouped[:, : modes.shape[1]] = modes
            for turbine, own_modes in zip(turbines, grouped, strict=True):
                split = own_modes.reshape(self._groups, layout.GROUP)
                self._modes(int(turbine))[...] = np.stack([split.real, split.imag], axis=1)
        own = self._own
        own[turbines] = 0.0
        own[turbines, layout.OWN_ANGLE : layout.OWN_ANGLE + setup.blades] = start.flap_angle[
            :, : setup.blades
        ]
        own[turbines, layout.OWN_RATE : layout.OWN_RATE + setup.blades] = start.flap_rate[:, : setup.blades]
        own[turbines, layout.OWN_AZIMUTH] = start.azimuth
        own[turbines, layout.OWN_LEVEL] = self._responses.level[turbines]
        own[turbines, layout.OWN_RESPONSE] = self._responses.place[turbines]
        noise = start.measurement_noise
        if noise is not None:
            self._keep_noise(turbines, noise)
        if start.flap_angle.any() or start.flap_rate.any():
            effectiveness = np.array(setup.faults.effectiveness)[: setup.blades]
            first[:, :8] += first_feedthrough(self._kernel.direct, start, effectiveness)
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
        filled = (observation, rows) if samples is None else (observation, rows, samples)
        if not all(array.flags.c_contiguous for array in filled):
            raise TypeError("observation, rows, samples: expected contiguous arrays")
        take = self._take_single if kind is FLOAT32 else self._take_double
        if samples is None:
            return take(self._address, actions, observation, rows)[0]
        if samples.dtype != FLOAT64:
            raise TypeError(f"samples: expected float64, got {samples.dtype}")
        self._handle[-2:] = samples.ctypes.data, samples.size
        try:
            return take(self._address, actions, observation, rows)[0]
        finally:
            self._handle[-1] = 0

    @property
    def quick(self) -> Quick:
        """`step` for flat float32 arrays and without samples, at the least cost of a call."""
        return partial(self._take_single, self._address)

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        own = self._own[turbine]
        return {
            "elapsed": int(own[layout.OWN_ELAPSED]),
            "flaps": own[: layout.OWN_TRAVEL].reshape(3, 3)[:, : self.setup.blades].tolist(),
            "travel": own[layout.OWN_TRAVEL : layout.OWN_TRAVEL + 3].tolist(),
            "modes": self._modes(turbine).astype(float).ravel().tolist(),
        }

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        own, blades = self._own[turbine], self.setup.blades
        own[layout.OWN_ELAPSED] = state["elapsed"]
        own[: layout.OWN_TRAVEL].reshape(3, 3)[:, :blades] = state["flaps"]
        own[layout.OWN_TRAVEL : layout.OWN_TRAVEL + 3] = state["travel"]
        modes = self._modes(turbine)
        modes[...] = np.reshape(state["modes"], modes.shape)


def aligned(numbers: FloatArray, precision: str) -> FloatArray:
    """A copy that begins at a multiple of ALIGNMENT bytes."""
    dtype = np.dtype(precision)
    room = np.empty(numbers.size + layout.ALIGNMENT // dtype.itemsize, dtype=dtype)
    skipped = (-room.ctypes.data % layout.ALIGNMENT) // dtype.itemsize
    room[skipped : skipped + numbers.size] = numbers
    return room[skipped : skipped + numbers.size]


def mode_constants(kernel: Kernel, groups: int) -> Array:
    """(groups, CONSTANTS, GROUP) in the order the compiled step reads them; the last group is filled up with zeros."""
    flap = kernel.flap
    reads = np.stack([flap.read.real, -flap.read.imag], axis=1).reshape(16, flap.order)
    rows = np.vstack(
        [flap.values.real, flap.values.imag, flap.drive.real.T, flap.drive.imag.T, reads],
    )
    constants = np.zeros((layout.CONSTANTS, groups * layout.GROUP))
    constants[:, : flap.order] = rows
    return constants.reshape(layout.CONSTANTS, groups, layout.GROUP).transpose(1, 0, 2)
