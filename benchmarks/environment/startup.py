"""What a user waits for, in a fresh interpreter: import, first `make`, `reset` and `step`, later resets."""

from __future__ import annotations

import json
import subprocess
import sys

_PROGRAM = """
import json, time
times, last = {}, time.perf_counter()
def mark(name):
    global last
    now = time.perf_counter()
    times[name], last = now - last, now
import numpy, gymnasium
mark("import numpy and gymnasium")
import flapgym
mark("import flapgym")
env = gymnasium.make("flapgym/NREL5MW-v1")
mark("first make")
env.reset(seed=0)
mark("first reset")
action = env.action_space.sample()
last = time.perf_counter()
env.step(action)
mark("first step")
env = gymnasium.make("flapgym/NREL5MW-v1", duration=267.0)
mark("make with episodes of 267 s")
env.reset()
last = time.perf_counter()
resets = []
for _ in range(20):
    env.reset()
    mark("reset of 267 s")
    resets.append(times["reset of 267 s"])
times["reset of 267 s"] = min(resets)
pooled = gymnasium.make("flapgym/NREL5MW-v1", duration=267.0, wind={"pool": 2})
for seed in range(20):
    pooled.reset(seed=seed)
last = time.perf_counter()
pooled.reset()
mark("the same from a pool")
print(json.dumps(times))
"""


def startup(repetitions: int) -> dict[str, float]:
    """Seconds of wall time, the least of several fresh interpreters; the compiled code is in its cache."""
    results = []
    for _ in range(repetitions + 1):
        run = subprocess.run([sys.executable, "-c", _PROGRAM], capture_output=True, text=True, check=True)
        results.append(json.loads(run.stdout))
    # The first one may have had to compile.
    return {name: min(result[name] for result in results[1:]) for name in results[0]}
