"""CPU time of the predictive controller's optima by solver: `python -m benchmarks.predictive_solvers`.

Takes those of half a minute of wind in which a stop is in sight, and solves each with every solver that is installed,
in turn and in one process: what counts are the ratios. Only DAQP is a dependency; quadprog, piqp, osqp and clarabel
join in where they are found.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from baselines.shipped import shipped_weights
from flapgym.control import PredictiveController
from flapgym.core.arrays import Array
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import simulate
from flapgym.model.turbine_model import load_model

SEED, SECONDS, COUNT = 2_000_000, 30.0, 400
Solve = Callable[[Array], Any]


def optima() -> tuple[Array, Array]:
    """Rows (N, m) that the offsets must correct, and what they do to them (m, n)."""
    model = load_model("nrel5mw-rated")
    agent = PredictiveController("mpc", model, shipped_weights("lqg_saturating", model))
    seen: list[Array] = []
    solve = agent.within

    def noted(action: Array, rows: Array, rate: Array) -> Array:
        seen.append(rows.copy())
        return solve(action, rows, rate)

    agent.within = noted  # type: ignore[method-assign]
    simulate(agent, model, [SEED], SECONDS)
    picked = np.random.default_rng(0).choice(len(seen), min(COUNT, len(seen)), replace=False)
    return np.array(seen)[picked], agent.horizon.from_offsets


def daqp(module: Any, g: Array) -> Solve:
    """Dual active set; what the controller uses."""
    m, n = g.shape
    model = module.Model()
    model.settings = {"primal_tol": 1e-9}
    model.setup(np.eye(n), np.zeros(n), g, np.ones(m), -np.ones(m), np.zeros(m, dtype=np.int32))

    def solve(rows: Array) -> Any:
        model.update(bupper=1.0 - rows, blower=-1.0 - rows)
        return model.solve()[0]

    return solve


def quadprog(module: Any, g: Array) -> Solve:
    """Dual active set of Goldfarb and Idnani, set up anew each time."""
    n = g.shape[1]
    both = np.hstack([-g.T, g.T])
    return lambda rows: module.solve_qp(
        np.eye(n), np.zeros(n), both, np.concatenate([rows - 1.0, -1.0 - rows])
    )[0]


def piqp(module: Any, g: Array) -> Solve:
    """Interior point, dense."""
    m, n = g.shape
    solver = module.DenseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-9
    solver.setup(np.eye(n), np.zeros(n), None, None, g, -np.ones(m), np.ones(m), None, None)

    def solve(rows: Array) -> Any:
        solver.update(h_l=-1.0 - rows, h_u=1.0 - rows)
        solver.solve()
        return solver.result.x.copy()

    return solve


def osqp(module: Any, g: Array) -> Solve:
    """Operator splitting, to 1e-4."""
    m, n = g.shape
    solver = module.OSQP()
    identity, constraints = sp.csc_matrix(np.eye(n)), sp.csc_matrix(g)
    accuracy = {"eps_abs": 1e-4, "eps_rel": 1e-4, "max_iter": 20000, "verbose": False}
    solver.setup(identity, np.zeros(n), constraints, -np.ones(m), np.ones(m), **accuracy)

    def solve(rows: Array) -> Any:
        solver.update(l=-1.0 - rows, u=1.0 - rows)
        return solver.solve().x

    return solve


def clarabel(module: Any, g: Array) -> Solve:
    """Interior point, set up anew each time."""
    m, n = g.shape
    identity, both = sp.csc_matrix(np.eye(n)), sp.csc_matrix(np.vstack([g, -g]))
    settings = module.DefaultSettings()
    settings.verbose = False
    cones = [module.NonnegativeConeT(2 * m)]

    def solve(rows: Array) -> Any:
        bound = np.concatenate([1.0 - rows, 1.0 + rows])
        return np.array(module.DefaultSolver(identity, np.zeros(n), both, bound, cones, settings).solve().x)

    return solve


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    makers = (daqp, quadprog, piqp, osqp, clarabel)
    names = [make.__name__ for make in makers]
    installed = [
        (make, importlib.import_module(make.__name__))
        for make in makers
        if importlib.util.find_spec(make.__name__) is not None
    ]
    if not installed:
        raise ImportError(f"none of {', '.join(names)} is installed: pip install 'flapgym[mpc]'")

    def work() -> int:
        found, g = optima()
        solvers: dict[str, Solve] = {make.__name__: make(module, g) for make, module in installed}
        spent: dict[str, list[float]] = {name: [] for name in solvers}
        apart = dict.fromkeys(solvers, 0.0)
        for rows in found:
            first: float | None = None
            for name, solve in solvers.items():
                begin = time.perf_counter()
                offsets = solve(rows)
                spent[name].append(time.perf_counter() - begin)
                first = float(offsets[0]) if first is None else first
                apart[name] = max(apart[name], abs(float(offsets[0]) - first))
        print(f"{len(found)} optima of {g.shape[1]} offsets between {g.shape[0]} pairs of bounds")
        print(
            "\n| solver | median [us] | 99 of 100 [us] | first offset apart from DAQP's |\n|---|---|---|---|"
        )
        for name, times in spent.items():
            median, most = 1e6 * np.percentile(times, [50, 99])
            print(f"| {name} | {median:.0f} | {most:.0f} | {apart[name]:.0e} |")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.predictive_solvers", description=__doc__)
    parser.set_defaults(door=_door, program="benchmarks.predictive_solvers")
    return parser


if __name__ == "__main__":
    sys.exit(main())
