# Two commands do everything on a fresh machine: `make report` and `make test`.
VENV   := .venv
BIN    := $(VENV)/bin
# Python 3.11 is preferred, because PyBullet has wheels for it alone. `make PYTHON=/path/to/python report` takes another.
IS_NEW := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PYTHON ?= $(shell for python in python3.11 python3; do "$$python" $(IS_NEW) 2> /dev/null && echo "$$python" && break; done)

# Extras that are too large for the environment of `make test`, or exclude one another: each is tested in its own environment.
HEAVY_ENGINES := mjx mujoco-warp newton sapien exudyn jsbsim genesis brax ode box3d rapier-js cannon-es jolt havok
# Packages of npm, which take the place of an extra.
NPM_rapier-js := @dimforge/rapier3d-compat
NPM_cannon-es := cannon-es
NPM_jolt := jolt-physics
NPM_havok := @babylonjs/havok

# Many processes start in tests: with the bytecode of the package kept, beside numba's kernels, each costs a third.
unexport PYTHONDONTWRITEBYTECODE
# Two workers on two processors: threads of BLAS, whose matrices are small here, would only wait for each other.
test test-browser test-all fuzz coverage: export OPENBLAS_NUM_THREADS := 1

.PHONY: report test test-browser test-engines test-all fuzz faults coverage bench examples docs site lint clean

report: $(VENV)/.installed            ## set up, run the core catalogue, say where the report is
	$(BIN)/dropspin run

test: $(VENV)/.installed-dev          ## set up, run the test suite
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow and not extended"

test-browser: $(VENV)/.installed-browser  ## the report, the replay and the site in a real browser; needs Chromium
	$(BIN)/python -m pytest -n 2 --dist worksteal tests/browser

test-all: lint test test-browser docs ## everything, and the studies that take minutes
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "slow or extended"

test-engines: $(HEAVY_ENGINES:%=test-engine-%)  ## adapters of engines with an environment of their own; one alone: make test-engine-mjx

test-engine-%: .venvs/%/.installed
	.venvs/$*/bin/python -m pytest tests/heavy_engines --engine $*

fuzz: $(VENV)/.installed-dev          ## commands with damaged files, wrong adapters and odd options: FUZZ_CASES=2000 FUZZ_SEED=0
	FUZZ_CASES=$(or $(FUZZ_CASES),2000) $(BIN)/python -m pytest -n 2 --dist worksteal tests/fuzz

faults: $(VENV)/.installed-dev        ## engines with one planted fault each against the core catalogue: docs/faults.md
	PYTHONPATH=tests $(BIN)/python -m support.fault_suite
	PYTHONPATH=tests $(BIN)/python -m support.detection_power

coverage: $(VENV)/.installed-dev      ## how often intervals are right: docs/coverage.md, and the table in docs/measured.md
	PYTHONPATH=tests $(BIN)/python -m support.interval_coverage
	PYTHONPATH=tests $(BIN)/python -m support.log_coverage

bench: $(VENV)/.installed             ## speed beside the engines, as ratios: out/bench.json, out/bench.svg
	$(BIN)/python benchmarks/speed.py
	$(BIN)/python benchmarks/batch.py
	$(BIN)/python benchmarks/vertices.py
	$(BIN)/python benchmarks/run_cost.py

examples: $(VENV)/.installed         ## the pictures of docs/examples.md, each by its own lines
	$(BIN)/python docs/examples/draw.py

docs: $(VENV)/.installed-dev          ## the documentation, links within it checked: out/site/index.html
	$(BIN)/python -m sphinx -q -W --keep-going docs out/site

site: $(VENV)/.installed-dev          ## the documentation with the pages of the record in record/: out/site/releases/index.html
	$(BIN)/python -m sphinx -q -W --keep-going -t releases docs out/site
	$(BIN)/dropspin record publish record -o out/site/releases

lint: $(VENV)/.installed-dev          ## style, types, import contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf $(VENV) .venvs out

$(VENV)/bin/python:
	@"$(PYTHON)" $(IS_NEW) 2> /dev/null || \
	  { echo "error: dropspin needs Python 3.11 or later, found: $$("$(or $(PYTHON),python3)" --version 2>&1); install one," \
	    "or name one: make PYTHON=/path/to/python" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2> /dev/null || \
	  { echo "error: $(PYTHON) cannot make environments; install its module venv (Debian, Ubuntu: apt-get install python3-venv)" >&2; exit 1; }
	"$(PYTHON)" -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@$(BIN)/python -c 'import pybullet' 2> /dev/null || \
	  echo "PyBullet is left out, and tests that use it: it has wheels for CPython 3.11 on Linux x86-64 only." \
	    "$(BIN)/pip install pybullet tries to compile it, which takes long."
	touch $@

# `pip install --group` needs pip 25.1.
$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --group dev
	touch $@

.venvs/%/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m venv .venvs/$*
	.venvs/$*/bin/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"
	.venvs/$*/bin/python -m pip install --quiet --disable-pip-version-check --group test --editable '.$(if $(NPM_$*),,[$*])'
	$(if $(NPM_$*),npm install --no-save --ignore-scripts --no-audit --loglevel=error --prefix .venvs/$* $(NPM_$*))
	touch $@

.PRECIOUS: .venvs/%/.installed

$(VENV)/.installed-browser: $(VENV)/.installed-dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --group browser
	touch $@
