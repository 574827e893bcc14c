PYTHON ?= python3
VENV ?= .venv
SCENARIO ?= fast_turn_unknown_dynamics
FUZZ ?= 5000
MUTANTS ?= 48
SEED ?= 1
# The lowest and the highest Python that the README promises.
LOWEST_PYTHON ?= python3.10
HIGHEST_PYTHON ?= python3.13

# The package is installed as a user would have it, anew when anything that is installed has changed:
# the name of the stamp carries a checksum of it all.
INSTALLED_FROM := setup.py setup.cfg pyproject.toml package.xml config launch resource ros2_run skydiver_utc
CHECKSUM := $(shell find $(INSTALLED_FROM) -type f -not -path '*/__pycache__/*' | LC_ALL=C sort | xargs sha256sum | sha256sum | cut -c 1-16)
STAMP := $(VENV)/installed-$(CHECKSUM)

export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
# Packages come without bytecode, and containers often forbid Python to keep it: each process would start a second later.
export PYTHONDONTWRITEBYTECODE :=
# Tests run in as many processes as there are cores: threads of their own would only wait for each other.
test test-fast: export OPENBLAS_NUM_THREADS := 1

.PHONY: help install demo docs film test test-fast lowest highest fuzz mutants kills lint bench bench-tools worst compared references rivals-tools tools bench-ros paper soak network package clean

help:
	@echo "make demo      run SCENARIO ($(SCENARIO)) over ROS, recorded below bags/"
	@echo "make test      all tests, on up to four cores; ARGS=... goes to pytest"
	@echo "make test-fast the tests that start no processes and take seconds"
	@echo "make lowest    the tests of test-fast with the lowest versions of setup.py on LOWEST_PYTHON ($(LOWEST_PYTHON)); highest: the newest on HIGHEST_PYTHON ($(HIGHEST_PYTHON))"
	@echo "make fuzz      damaged scenarios, CSV files, recordings and messages, FUZZ=$(FUZZ) of each kind from SEED=$(SEED); some minutes"
	@echo "make mutants   the core with one operator, number or statement changed, MUTANTS=$(MUTANTS) times from SEED=$(SEED): do its tests see it; some half an hour of one core"
	@echo "make kills     kill the recorder 20 times during a run, count what is recovered"
	@echo "make lint      ruff and mypy"
	@echo "make docs      the documentation site, into build/site; runs every example; some minutes; ARGS=-Dplot_gallery=0: none of them"
	@echo "make film      the film on the first page, into docs/figures/skydiver.gif"
	@echo "make bench     time the plant, the controllers and the closed loop; bench-tools: CasADi, do-mpc and OSQP, too"
	@echo "make worst     the slowest of a million steps of UTC; some four minutes"
	@echo "make compared  UTC, LQR and nonlinear MPC on six textbook plants, into docs/compared.md; some five minutes"
	@echo "make references fly every reference within reach with UTC and two rivals; some ten minutes; ARGS=--skydiver=paper"
	@echo "make rivals-tools fly CasADi, do-mpc and OSQP on the fast turn with their tuned costs; some ten minutes"
	@echo "make bench-ros time a run over four processes beside a bare rclpy loop of four; some three minutes"
	@echo "make paper     make all of docs/paper and docs/figures/tuning again; some twenty minutes"
	@echo "make soak      30 simulated minutes in lockstep, 10 minutes in real time: memory, losses, lateness"
	@echo "make network   run over two machines with a network between them that delays and loses; Linux, root"
	@echo "make package   build a wheel and an sdist, and run the wheel alone, without ROS"
	@echo "make install   only install into $(VENV)"
	@echo "make clean     remove what builds and tests left behind; keeps $(VENV) and bags/"

# A wheel and an sdist of the files under version control, and the wheel alone, without ROS, in an environment of its own.
package: $(STAMP)
	rm -rf build/package && mkdir -p build/package
	git archive HEAD | tar -x -C build/package
	cd build/package && ../../$(VENV)/bin/python -m pip wheel --quiet --no-deps --no-build-isolation -w dist .
	cd build/package && ../../$(VENV)/bin/python setup.py --quiet sdist
	$(PYTHON) -m venv build/package/venv
	build/package/venv/bin/pip install --quiet --disable-pip-version-check build/package/dist/*.whl
	cd build/package/dist && ../venv/bin/skydiver-utc simulate fast_turn_pi_dynamics
	cd build/package/dist && ../venv/bin/python ../examples/scalar_linear.py
	tar -tzf build/package/dist/*.tar.gz | grep -q test/package/test_distribution.py

install: $(STAMP)

demo: $(STAMP)
	$(VENV)/bin/skydiver-utc run $(SCENARIO)

test: $(STAMP)
	ROS_PYTHON_CHECK_FIELDS=1 $(VENV)/bin/pytest -n auto --maxprocesses 4 --dist worksteal $(ARGS)

test-fast: $(STAMP)
	ROS_PYTHON_CHECK_FIELDS=1 $(VENV)/bin/pytest -n auto --maxprocesses 4 --dist worksteal -m 'not long and not processes' $(ARGS)

# Without yeadon and pin, which need a newer numpy: their tests are skipped.
lowest:
	rm -rf build/lib build/lowest
	$(LOWEST_PYTHON) -m venv build/lowest
	sed -n '/install_requires/,/]/s/.*"\(.*\)>=\(.*\)",/\1==\2/p' setup.py >build/lowest/versions.txt
	build/lowest/bin/python -m pip install --quiet --no-compile --disable-pip-version-check 'pip>=24' 'setuptools>=77'
	build/lowest/bin/python -m pip install --quiet --disable-pip-version-check --no-build-isolation \
	  -c build/lowest/versions.txt '.[ros]' hypothesis ipykernel mcap-ros2-support nbclient pytest pytest-xdist
	ROS_PYTHON_CHECK_FIELDS=1 build/lowest/bin/pytest -n auto --maxprocesses 4 --dist worksteal -m 'not long and not processes' $(ARGS)

highest:
	$(MAKE) test-fast PYTHON=$(HIGHEST_PYTHON) VENV=build/highest

fuzz: $(STAMP)
	SKYDIVER_UTC_FUZZ=$(FUZZ) SKYDIVER_UTC_FUZZ_SEED=$(SEED) $(VENV)/bin/pytest -q -n auto -o faulthandler_timeout=3600 test/fuzz $(ARGS)

mutants: $(STAMP)
	nice $(VENV)/bin/python -u benchmarks/mutants.py --count $(MUTANTS) --seed $(SEED) $(ARGS)

kills: $(STAMP)
	SKYDIVER_UTC_KILLS=20 $(VENV)/bin/pytest -q test/ros/processes/test_recorded_nodes.py $(ARGS)

lint: $(STAMP)
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy

# Without warnings: a link that leads nowhere ends the build.
docs: $(STAMP)
	$(VENV)/bin/python -m sphinx -W --keep-going --quiet -b html -c docs -d build/doctrees $(ARGS) . build/site

film: $(STAMP)
	$(VENV)/bin/python examples/film.py docs/figures/skydiver.gif

bench: $(STAMP)
	$(VENV)/bin/python benchmarks/run.py $(ARGS)

bench-tools: tools
	$(VENV)/bin/python benchmarks/run.py $(ARGS)

worst: $(STAMP)
	$(VENV)/bin/python benchmarks/worst.py $(ARGS)

compared: tools
	$(VENV)/bin/python benchmarks/compared.py --write

references: $(STAMP)
	$(VENV)/bin/python benchmarks/references.py $(ARGS)

rivals-tools: tools
	$(VENV)/bin/python benchmarks/rivals.py --tool-chains

tools: $(STAMP)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --no-build-isolation '.[bench]'

bench-ros: $(STAMP)
	$(VENV)/bin/python benchmarks/four_processes.py $(ARGS)

paper: $(STAMP)
	$(VENV)/bin/skydiver-utc compare paper --out docs/paper
	$(VENV)/bin/python benchmarks/tuning_guide.py docs/figures/tuning

soak: $(STAMP)
	$(VENV)/bin/python benchmarks/soak.py $(ARGS)

network: $(STAMP)
	$(VENV)/bin/python benchmarks/network.py $(ARGS)

clean:
	rm -rf build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find $(INSTALLED_FROM) test benchmarks -name __pycache__ -prune -exec rm -rf {} +

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

# setuptools copies whatever an earlier build left in build/lib, deleted modules too.
$(STAMP): | $(VENV)/bin/python
	@echo "Installing skydiver_utc into $(VENV); the first time takes some minutes."
	rm -rf build/lib build/bdist.*
	$(VENV)/bin/python -m pip install --quiet --no-compile --disable-pip-version-check 'pip>=24' 'setuptools>=77'
	$(VENV)/bin/python -m pip install --quiet --no-compile --disable-pip-version-check --no-build-isolation '.[ros,studies,test,docs,dev]'
	@echo "Compiling the model, once for each installation."
	$(VENV)/bin/skydiver-utc simulate fast_turn_unknown_dynamics --set duration_s=0.1 --quiet --json >/dev/null
	rm -f $(VENV)/installed-*
	touch $@
