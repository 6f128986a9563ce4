# Everything a person does with this checkout; `make` alone lists the targets. Nothing is written outside of it.

.DEFAULT_GOAL := help
SHELL := /bin/bash
PYTHON ?= python3
BIN := .venv/bin

# Python wheels of ROS 2 set these for their own venv only; another venv's values would mislead ours.
unexport VIRTUAL_ENV PYTHONHOME
ifdef _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH
endif

# A venv is made for one ROS 2 distribution or for the wheels; sourcing another one makes it anew.
READY := .venv/.ready-$(or $(ROS_DISTRO),wheels)
PACKAGE := .venv/.package
MESSAGES := .venv/.messages
KERNELS := .venv/.kernels
LOAD := source tools/environment.sh && $(BIN)/python tools/stress/under_load.py $(if $(SECONDS),--seconds $(SECONDS) --docs out)
STAND_IN := .venv/.stand_ins

help:  ## list the targets
	@sed -nE 's/^([a-z]+):.*## (.*)/make \1|\2/p' $(MAKEFILE_LIST) | while IFS='|' read -r target text; do printf '%-14s %s\n' "$$target" "$$text"; done

setup: $(PACKAGE) $(MESSAGES) $(KERNELS)  ## make .venv/ with pinned versions, ROS 2 wheels if no distribution is sourced, ldcs_msgs

sim: setup  ## run the live node: SCENE=paper RTF=1 DURATION=0 RECORD=out/NAME NETWORK=0
	@SCENE='$(SCENE)' RTF='$(RTF)' DURATION='$(DURATION)' RECORD='$(RECORD)' NETWORK='$(NETWORK)' exec tools/sim.sh

# Tests marked `timed` hold their limits of time while nothing else runs. The others use all cores.
TIMED := $(wildcard test/bags test/cli test/estimate test/faults test/rig test/ros)
# Types are checked against the wheels of ROS 2; a distribution's own rclpy has others, or none.
test: setup lint $(if $(ROS_DISTRO),,types) $(STAND_IN)  ## check style and types, then run the test suite but the slow ones: PYTEST='-k word'
	@source tools/environment.sh && export ROS_PYTHON_CHECK_FIELDS=1 && $(if $(PYTEST),exec $(BIN)/python -m pytest $(PYTEST), \
		$(BIN)/python -m pytest --numprocesses auto --dist loadfile -m "not timed and not slow"; untimed=$$?; \
		$(BIN)/python -m pytest -m "timed and not slow" $(TIMED) && exit $$untimed)

slow: setup $(STAND_IN)  ## run the tests that `make test` leaves out: longer siblings of its own
	@source tools/environment.sh && export ROS_PYTHON_CHECK_FIELDS=1 && exec $(BIN)/python -m pytest -m slow

reduced: setup  ## train the reduced model of the rig and measure it on 200 held-out runs: RUNS=30 for fewer
	@$(BIN)/python tools/reduced_figures.py $(RUNS)

reach: setup  ## measure inverse statics: random places of the rig, shapes of the mould with their bounds: COUNT=10 SEED=3
	@$(BIN)/python tools/reach_figures.py $(or $(COUNT),100) $(or $(SEED),1)

derivatives: setup  ## measure derivatives along runs: WHAT="cost gradient errors identify" for all
	@$(BIN)/python tools/derivative_figures.py $(or $(WHAT),cost gradient)

bench: setup  ## watch the speed: ratios to a compiled loop in one run, and where they became worse
	@$(BIN)/python -m pytest -q -s bench

lint: $(PACKAGE)  ## check the style and the spelling
	@$(BIN)/ruff check --quiet .
	@$(BIN)/typos --format brief .

hard: setup  ## run the hard cases that docs/hard_cases.csv lacks, write docs/hard_cases.md: HARD='--only floor' for a few
	@$(BIN)/ldcs study --hard -o $(if $(HARD),out/hard,docs) $(HARD); missed=$$?; \
	  $(if $(HARD),true,source tools/environment.sh && LDCS_EXAMPLES=400 $(BIN)/python -m pytest -q --timeout=3600 \
	  test/hard/test_drawn_scenes.py) && exit $$missed

viewer: setup  ## install the viewer of `ldcs view` (half a gigabyte) and check it in a headless chromium
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes --requirement requirements/view.lock
	@source tools/environment.sh && exec $(BIN)/python -m pytest -q test/viewing

cluster: setup  ## install Dask, and run sweeps and a study on a local cluster of it
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes --requirement requirements/cluster.lock
	@source tools/environment.sh && exec $(BIN)/python -m pytest -q -k "dask or scheduler or worker" test/sweep test/study

soak: setup  ## run the live node for an hour at 200 Hz, write docs/under_load.md: SECONDS=60 for a short one, into out/
	@$(LOAD) soak

fuzz: setup  ## send random messages, calls, parameters for ten minutes, write docs/under_load.md: SECONDS=60 SEED=7
	@$(LOAD) fuzz --seed $(or $(SEED),7)

faults: setup  ## flood, joining subscribers, kill -9, a full disk (three minutes), write docs/under_load.md
	@$(LOAD) flood joins kill disk

hostile: setup  ## give 1000 mutated bags to six verbs and read 3000 mutated YAML files, print the counts: COUNT=50 SEED=7
	@$(BIN)/python tools/stress/hostile_files.py --seed $(or $(SEED),1) $(if $(COUNT),--bags $(COUNT) --files $(COUNT))

attack: setup  ## attack the bridge with each event of the table (half an hour), write it into docs/bridge.md: ATTACK='--only serial'
	@source tools/environment.sh && exec $(BIN)/python tools/attack $(or $(ATTACK),--slow --write docs/bridge.md)

# Rooms with the floor of the lines that their own tests run [%], a little below the number reached. Compiled kernels are
# invisible to it: `physics` runs in plain Python, `integrators` and the rooms that only processes of ROS run are left out.
FLOORS := schema:60 scene:93 sensors:96 messages:92 signals:85 bags:93 physics:90 twin:88 plotting:71 compare:83 replay:86
coverage: setup  ## measure the lines of each room that its tests run, with a floor for each: FLOORS='scene:93' for one
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --requirement requirements/coverage.lock
	@source tools/environment.sh && for each in $(FLOORS); do room=$${each%:*}; \
		$$([ $$room = physics ] && echo env LDCS_NO_NUMBA=1) $(BIN)/python -m pytest -q -p no:cacheprovider --cov=ldcs_ros.$$room \
			--cov-report=term:skip-covered --cov-fail-under=$${each#*:} test/$$room || exit 1; done

mutants: setup  ## change operators and constants of the inner rooms, list the changes that no test catches: MUTANTS='physics --count 20'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --requirement requirements/coverage.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --requirement requirements/mutants.lock
	@source tools/environment.sh && $(BIN)/python tools/mutation.py $(MUTANTS)

types: $(PACKAGE) $(MESSAGES)  ## check the types
	@$(BIN)/mypy

msgs: setup  ## build the interface packages again: ldcs_msgs, and what stands in for packages of ROS in tests
	@source tools/environment.sh && $(BIN)/python tools/build_messages.py && touch $(MESSAGES) $(STAND_IN)

colcon: setup  ## build both packages with colcon into install/, then check what it installed
	@tools/colcon.sh

bags: setup  ## make the reference bags in bags/ again: BAGS='chirp fault'
	@$(BIN)/python tools/make_bags.py $(BAGS)

docs: setup  ## write docs/reference.md and the SROS2 policy anew from the tables of the code
	@$(BIN)/python tools/make_reference.py
	@$(BIN)/python tools/make_policy.py

site: setup  ## build the site of the docs into out/site, check its links, and its search if a chromium is here
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes --requirement requirements/site.lock
	@$(BIN)/python tools/make_site.py
	@source tools/environment.sh && exec $(BIN)/python -m pytest -q test/docs/test_site.py

wheel:  ## build the wheel into out/dist, install it by pip into an environment of its own and run it: EXTRAS=data,ros
	@PYTHON='$(PYTHON)' EXTRAS='$(EXTRAS)' tools/wheel.sh

notebooks: setup  ## run the notebooks in docs/notebooks and keep their outputs (two minutes)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes --requirement requirements/notebooks.lock
	@source tools/environment.sh && $(BIN)/python tools/run_notebooks.py

lock: setup  ## write the lock files anew with the newest versions (needs uv)
	@tools/lock.sh

clean:  ## remove all that the other targets made, except the bags in out/
	rm -rf .venv build install log ldcs_ros.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find ldcs_ros test tools -name __pycache__ -type d -prune -exec rm -rf {} +

$(READY): requirements/core.lock requirements/ros.lock
	@command -v $(PYTHON) >/dev/null || { echo "setup: no $(PYTHON) here; expected Python 3.10 to 3.14" >&2; exit 1; }
	@$(PYTHON) tools/setup_venv.py
	@touch $@

$(PACKAGE): $(READY) setup.py setup.cfg package.xml pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

# The twin runs without ldcs_msgs, so set-up goes on; without a stamp the next one tries again.
$(MESSAGES): $(READY) $(shell find msg_defs -type f)
	@source tools/environment.sh; $(BIN)/python tools/build_messages.py ldcs_msgs && touch $@ || true

# An edit of a kernel compiles all anew, at the first run or here.
$(KERNELS): $(PACKAGE)
	@$(BIN)/python tools/compile_kernels.py && touch $@

# Half a minute, once; without it the tests that need it are skipped.
$(STAND_IN): $(READY) $(shell find test/ros/stand_ins -type f) | $(MESSAGES)
	@source tools/environment.sh; $(BIN)/python tools/build_messages.py simulation_interfaces tf2_msgs && touch $@ || true

.PHONY: help setup sim test slow reduced reach derivatives bench lint hard viewer cluster soak fuzz faults hostile attack coverage mutants types msgs colcon bags docs site wheel notebooks lock clean
