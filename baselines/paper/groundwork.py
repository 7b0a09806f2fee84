"""The report's numbers in several processes: each job leaves its own in the cache, where the sections find them."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.pool import Pool
from pathlib import Path
from typing import Any, NoReturn

from baselines.models import VARIATIONS
from baselines.paper.readings import FLAPS
from baselines.paper.study import BESIDE, Study
from baselines.rivals.contestants import rivals
from baselines.scores import SIDE_BY_SIDE
from flapgym.control import OpenLoop
from flapgym.model.turbine_model import TurbineModel

RIVAL_NUMBERS = ("horizons", "ideal", "solve_times", "single_blade", "margins", "equal_load")
FIGURES = ("figure8", "figure12", "figure9", "figure15", "table2")


@dataclass(frozen=True)
class Job:
    """A method of `Study` that leaves what it finds in the cache, and its arguments."""

    method: str
    arguments: tuple[Any, ...] = ()

    def __str__(self) -> str:
        return " ".join(map(str, (self.method, *self.arguments)))

    def run(self, study: Study) -> None:
        """Do it."""
        getattr(study, self.method)(*self.arguments)


def stages(study: Study, parts: Collection[str]) -> list[list[Job]]:
    """Jobs of the parts, long ones first; those of a stage need none of each other, only those of the stages before."""
    wanted, quick = set(parts), study.quick
    scored, judged = bool(wanted & {"gust_alleviation", "effects"}), "robustness" in wanted
    beside = BESIDE if "effects" in wanted else ()
    varied = VARIATIONS if "trials" in wanted or (judged and not quick) else ()
    rival = [each.agent.name for each in rivals(study.model)] if "rivals" in wanted else []
    models = [
        *([Job("responses")] if "turbine" in wanted else []),
        *([Job("design_models")] if (scored or judged) and not quick else []),
        *([Job("further_loads")] if scored else []),
        *([Job("unscaled")] if "readings" in wanted else []),
        *(Job("variation", (label,)) for label in varied),
        *(Job(name) for name in FIGURES if name in wanted),
    ]
    rest = [name for name in (*study.names, *beside, OpenLoop.name) if scored]
    groups = [rest[first : first + SIDE_BY_SIDE] for first in range(0, len(rest), SIDE_BY_SIDE)]
    designs = [
        *(Job("rival_number", (name,)) for name in RIVAL_NUMBERS if rival),
        *(Job("agent", (name,)) for name in study.names if (scored or judged) and not quick),
        *(Job("rival", (name,)) for name in reversed(rival)),
        *(Job("reading", (flap, own)) for flap in FLAPS for own in (False, True) if "readings" in wanted),
        *(Job("outcomes", (label,)) for label in (study.conditions if "trials" in wanted else ())),
    ]
    scores = [
        *(Job("scored_together", tuple(group)) for group in groups),
        *(Job("judged", (name,)) for name in (study.linear if judged else ())),
        *([Job("settled_rate")] if "gust_alleviation" in wanted else []),
    ]
    return [stage for stage in (models, designs, scores) if stage]


def worked(
    jobs: list[Job], processes: int, model: TurbineModel, folder: Path, realisations: int, quick: bool
) -> Iterator[Job]:
    """Do the jobs of one stage in so many processes; each is given when it is done.

    An interrupt stops the processes; what they had finished stays in the cache.
    """
    # Started anew, not forked: a fork would copy the locks of numerical libraries in whatever state they are.
    spawn = multiprocessing.get_context("spawn")
    pool: Pool | None = None
    try:
        with _undisturbed():
            pool = spawn.Pool(min(processes, len(jobs)), _begin, (model, folder, realisations, quick))
        yield from pool.imap_unordered(_do, jobs)
        pool.close()
    except BaseException:
        if pool is not None:
            pool.terminate()
        raise
    finally:
        if pool is not None:
            pool.join()


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Hear an interrupt only afterwards: a process whose start is cut short would complain.

    Processes started meanwhile never hear one. From a terminal it goes to all of them; the first one ends the others.
    """
    heard = list[int]()
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    blocks = hasattr(signal, "pthread_sigmask")  # not on Windows
    # What is started inherits the mask; here another thread may take the signal all the same.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if blocks else set()
    try:
        yield
    finally:
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, before)
    if heard:
        raise KeyboardInterrupt


_study: Study | None = None
"""Of a worker."""


def _begin(model: TurbineModel, folder: Path, realisations: int, quick: bool) -> None:
    global _study
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    _study = Study(model, folder, realisations, quick, lambda what: None)


def _leave(number: int, frame: Any) -> NoReturn:
    sys.exit(1)


def _do(job: Job) -> Job:
    assert _study is not None
    job.run(_study)
    return job
