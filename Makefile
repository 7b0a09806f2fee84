# The whole workflow. Each target makes .venv when it is missing and installs only what it needs.
# Another interpreter: make compare PYTHON=/path/to/python3.12. Options for the program: make compare ARGS="--realisations 20".

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help compare lifetime tables paper validate train test lint bench fuzz clean

BIN := .venv/bin
ARGS ?=
# The first of these that is Python 3.11 or 3.12; looked for only when .venv has to be made.
PYTHON ?= $(shell for python in python3.11 python3.12 python3; do \
	if $$python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null; \
	then echo $$python; break; fi; done)

help:  ## list the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 12

compare: .venv/with-baselines  ## score every shipped agent: table, results/compare.{json,csv,md} and figure
	$(BIN)/flapgym compare $(ARGS)

lifetime: .venv/with-baselines  ## score agents over a turbine's life: table, results/lifetime.{json,csv,md} and figure
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/flapgym lifetime $(ARGS)

paper: .venv/with-baselines  ## the paper's Section IV beside ours: results/paper.{md,html} (ARGS: parts, --quick, --processes)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg $(BIN)/python -m baselines.paper $(ARGS)

tables: .venv/with-baselines  ## score every shipped agent in the environments reported on: docs/scores.md, tables of README.md
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.scores docs/scores.md README.md $(ARGS)

validate: .venv/with-baselines  ## the model beside OpenFAST: table, results/validation.{json,md,png} (ARGS: --model, --docs)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg $(BIN)/python -m benchmarks.validation $(ARGS)

train: .venv/with-train  ## train the PPO and SAC policies (ARGS: configurations)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m train.policies $(ARGS)

test: .venv/with-test  ## run the test suite on all cores (ARGS are pytest's)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg $(BIN)/python -m pytest -n auto --dist loadfile $(ARGS)

lint: .venv/with-test  ## check style, format and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: .venv/with-bench  ## measure speed on one core beside its peers: tables, results/bench.json (ARGS: parts, --docs)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.environment $(ARGS)

fuzz: .venv/with-test  ## load ten thousand mutated files of every kind (ARGS: --count, --seed, --kinds)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.fuzz $(ARGS)

clean:  ## remove .venv and caches; results stay
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .hypothesis

# One stamp for each set of extras, made only once its installation has succeeded.
.venv/with-baselines: EXTRAS := baselines
.venv/with-train: EXTRAS := baselines,train
.venv/with-bench: EXTRAS := baselines,bench
.venv/with-test: EXTRAS := baselines,train,test
.venv/with-%: pyproject.toml constraints.txt | $(BIN)/pip
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[$(EXTRAS)]'
	@touch $@

$(BIN)/pip:
	@test -n "$(PYTHON)" || { echo "flapgym needs Python 3.11 or 3.12: install one, or name it with make PYTHON=..." >&2; exit 1; }
	$(PYTHON) -m venv --clear .venv
