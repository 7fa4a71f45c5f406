# Every target does its own set-up: it finds a Python, makes .venv and fills it from the locked lists in requirements/.
# The set-up is stamped, so the second call costs nothing. `make PYTHON=/usr/bin/python3.12 test` chooses the Python
# for a new .venv; `make clean` removes an old one.

.DEFAULT_GOAL := help
.PHONY: help demo test cover test-guest lint check format campaign fuzz mutation soak bench reference lock clean

BIN := .venv/bin
SETUP := pyproject.toml requirements/install.sh

help:  ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' Makefile

demo: .venv/demo.stamp $(if $(findstring --page,$(ARGS)),.venv/web.stamp)  ## charge a simulated battery over real wire bytes, about a minute; ARGS=--page shows it in a browser
	$(BIN)/orchestrator demo $(ARGS)

# Modules are compiled once and beforehand, not by each worker and each of some thousand processes (which the variable
# would make them do): the first services would start so slowly beside it that they miss their own deadlines.
test: export PYTHONDONTWRITEBYTECODE :=
test: .venv/dev.stamp  ## all tests, five files at a time; ARGS='tests/core -k taper' chooses some
	$(BIN)/python -m compileall -q -j 0 orchestrator benchmarks tests
	$(BIN)/python -m pytest -n 5 --dist loadfile --no-loadscope-reorder $(ARGS)

# Measuring makes tests that compute three times as slow, so it is done with the tests of these parts alone, and with as
# few as reach everything: two of the core's only try much more of the same, and two files start whole stations and
# time them. The other tests run in `make test`.
COVERED := core interlock lastresort protocol
COVERING := tests/core tests/guardian tests/interlock tests/protocol tests/link/test_serial.py \
	tests/service/test_asking.py tests/whole/test_beginning.py --ignore=tests/guardian/test_estop.py --ignore=tests/guardian/test_kills.py \
	--deselect=tests/core/test_decide.py::test_whatever_comes_it_decides_soberly \
	--deselect=tests/core/test_decide.py::test_whatever_happened_a_person_gets_it_charging_again

cover: .venv/dev.stamp  ## hold the coverage of what decides and what stops: every branch of it, three minutes
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder $(COVERING) \
		$(COVERED:%=--cov=orchestrator.%) --cov-report=term-missing --cov-fail-under=100

test-guest: .venv/dev.stamp  ## the tests that need a kernel with SocketCAN and systemd, in a User Mode Linux
	$(BIN)/python -m tests.guest $(ARGS)

lint: .venv/dev.stamp  ## format, lint, types and import rules, about half a minute
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/test_imports.py

check: lint cover  ## both, then all tests with the branch coverage of everything
	$(BIN)/python -m pytest --cov --cov-report=term-missing $(ARGS)

format: .venv/dev.stamp  ## rewrite the files as `make check` wants them
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: .venv/demo.stamp  ## measure reaction times, memory and CPU beside a naive controller
	$(BIN)/python -m benchmarks $(ARGS)

campaign: .venv/dev.stamp  ## every proof in its long form, in minutes: state × fault, random faults, failing calls
	$(BIN)/python -m tests.proof $(ARGS)

soak: .venv/dev.stamp  ## 30 simulated days and a real hour on lines that lose frames; ARGS='--days 2 --minutes 5' less
	$(BIN)/python -m tests.proof.soak $(ARGS)

fuzz: .venv/fuzz.stamp  ## hours of hostile bytes at every door; ARGS='charger --runs 100000' chooses
	$(BIN)/python -m tests.fuzz $(ARGS)

mutation: .venv/mutation.stamp  ## see that the tests notice every small break; ARGS='orchestrator.protocol.*' chooses
	$(BIN)/python -m tests.mutation $(ARGS)

reference: .venv/reference.stamp  ## check the simulated battery against PyBaMM's, and both speeds
	$(BIN)/python -m benchmarks.reference $(ARGS)

lock:  ## choose the dependencies' versions anew: requirements/*.txt
	PYTHON='$(PYTHON)' sh requirements/lock.sh

clean:  ## remove everything that the other targets made
	rm -rf .venv build dist mutants *.egg-info .coverage .coverage.* .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# What its own command needs comes on top of the rest.
.venv/fuzz.stamp .venv/mutation.stamp .venv/reference.stamp: .venv/dev.stamp
.venv/%.stamp: requirements/%.txt $(SETUP)
	PYTHON='$(PYTHON)' sh requirements/install.sh $*
	touch $@
