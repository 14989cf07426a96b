# `make demo` and `make test` work on Linux and macOS with Python 3.11 or newer and make; all goes into .venv.
# The demo installs what the program needs; the others add what its tests need, to the same environment.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
TESTS := $(VENV)/.installed-tests

# Python compiles modules when they are first imported, and most of those installed never are. It must keep what it
# compiled, whatever an image says: tests start hundreds of processes.
unexport PYTHONDONTWRITEBYTECODE
INSTALL := pip install --quiet --disable-pip-version-check --no-compile

# Two processes; a folder's tests, which share compiled programs, run in one of them.
PYTEST = $(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder $(if $(SHARD),--shard=$(SHARD))

# What another folder, or another version, is tried in: environments of their own, made anew.
WHEEL := build/wheel
LOWEST := build/lowest
BEGIN := tests/outputs/test_templates.py tests/config/test_reading.py tests/outputs/test_outputs.py tests/plans/test_of_cells.py tests/api/test_searches.py

.PHONY: demo test thorough tests soak check bench bench-record docs images gallery site wheel lowest clean

demo: $(STAMP)
	$(BIN)/cspr table 2.1
	$(BIN)/cspr run sweeps/demo.toml -o results/demo
	$(BIN)/cspr plot results/demo/demo.h5 -o results/demo/demo.png
	@echo "Look at results/demo/demo.png; the data are in results/demo/demo.h5."

# Where time goes is in build/durations; SHARD=2/3 runs the second of three parts.
test: $(TESTS)
	$(PYTEST) --record=build/durations/test.jsonl -m "not soak and not thorough and not prose"

# Longer cases of what the quick tests cover.
thorough: $(TESTS)
	$(PYTEST) --record=build/durations/thorough.jsonl -m "thorough and not soak"

# Both in one run, which compiles a program once.
tests: $(TESTS)
	$(PYTEST) --record=build/durations/tests.jsonl -m "not soak and not prose"

# Full counts, new cases of what Hypothesis draws, and the shapes in signatures beside those of all calls.
soak: $(TESTS)
	$(BIN)/python -m pytest -m "soak or drawn"
	CSPR_TESTS_SHAPES=1 $(PYTEST) -m "not soak and not thorough and not prose"

check: $(TESTS)
	$(BIN)/ruff format --check cspr_jax tests benchmarks docs/gallery hatch_build.py
	$(BIN)/ruff check cspr_jax tests benchmarks docs/gallery hatch_build.py
	$(BIN)/mypy
	$(BIN)/python -m pytest -m prose tests/house

wheel: $(STAMP)
	rm -rf dist $(WHEEL)
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	$(PYTHON) -m venv $(WHEEL)
	$(WHEEL)/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	cd $(WHEEL) && bin/cspr --version && bin/cspr robots && bin/cspr examples table_2_1 && \
	  bin/cspr plan table_2_1.toml -o motion.h5 && bin/cspr plot motion.h5 && \
	  bin/cspr new sweep sweep.toml && bin/cspr run sweep.toml -o run && bin/cspr verify run

# Notebooks from their beginning, compared with what they show.
gallery: $(TESTS)
	$(BIN)/python docs/gallery/run.py

# The documents as a site, in build/site; what leads nowhere fails.
site: $(TESTS)
	$(BIN)/python -m sphinx -q -W -n --keep-going -d build/doctrees docs build/site

# Versions of the bounds in pyproject.toml; old ones warn of newer neighbours.
lowest:
	rm -rf $(LOWEST)
	$(PYTHON) -m venv $(LOWEST)
	$(PYTHON) tests/lowest.py > $(LOWEST)/bounds.txt
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check -c $(LOWEST)/bounds.txt --editable '.[test]'
	$(LOWEST)/bin/python -m pytest -m "not soak and not thorough" -n 2 -W ignore::DeprecationWarning $(BEGIN)

bench: $(TESTS)
	$(BIN)/cspr bench
	$(BIN)/python benchmarks/million_targets.py
	$(BIN)/python benchmarks/million_transitions.py
	$(BIN)/python benchmarks/million_segments.py
	$(BIN)/python benchmarks/million_lines.py
	$(BIN)/python benchmarks/attainability.py
	$(BIN)/python benchmarks/effective_amplitude.py
	$(BIN)/python benchmarks/store_cost.py

# On an idle machine: a line of benchmarks/history.jsonl, from which the site has a page of rates.
bench-record: $(TESTS)
	$(BIN)/python benchmarks/record.py

# Pages that are generated and committed; docs/conf.py writes the others into docs/built when the site is built.
docs: $(STAMP)
	$(BIN)/python docs/generate_reference.py
	$(BIN)/python docs/generate_command_line.py

# Sweeps and plans first, some two minutes; their results stay in results/images.
images: $(STAMP)
	$(BIN)/python docs/make_images.py

$(STAMP): pyproject.toml hatch_build.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "cspr_jax needs Python 3.11 or newer; call: make PYTHON=python3.11"; exit 1; }
	@echo "Installing jax, numpy, scipy, matplotlib, h5py and what they need into $(VENV), some 650 MB ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m $(INSTALL) --editable .
	@touch $(STAMP)

$(TESTS): $(STAMP)
	@echo "Installing what the tests, checks and documents need, too ..."
	@$(BIN)/python -m $(INSTALL) --editable '.[test]'
	@touch $(TESTS)

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis results/demo build dist docs/built
