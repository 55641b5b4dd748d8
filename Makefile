# SPDX-License-Identifier: Apache-2.0
# make demo: four simulated UAVs fly what the allocator plans.   make demo SCENARIO=survey: three
# survey a field.   make test: every check.
SHELL := /bin/bash
.SHELLFLAGS := -eo pipefail -c
.PHONY: demo test browser linted collected coverage build docs site clean
# messages, kernels, and checks of the sources or the browser's packages at a time; programs that
# recipes start have their own
MAKEFLAGS += -j3
unexport MAKEFLAGS

# some containers set it: then each process would compile the sources again, each test worker the tests
unexport PYTHONDONTWRITEBYTECODE

# node tests wait more than they compute: two have those, three compute
WORKERS := 5
# Ctrl-C ends a recipe, without what the programs in it report about that
STOP := trap 'exit 130' INT
ENV := . .ros/setup.sh
RUN := $(STOP); . install/setup.bash 2> /dev/null && export PATH="$(CURDIR)/.ros/bin:$$PATH"

# Of config/scenarios: demo, survey, ...
SCENARIO := demo
SCENARIOS := $(basename $(notdir $(wildcard config/scenarios/*.yaml)))
ifeq ($(origin SCENARIO)$(filter $(SCENARIO),$(SCENARIOS)),command line)
$(error SCENARIO = $(SCENARIO): expected one of $(SCENARIOS))
endif

demo: build
	@echo '== $(SCENARIO): $(shell sed -n 's/^# //p;q' config/scenarios/$(SCENARIO).yaml) Results go to out/$(SCENARIO)'
	@$(RUN) && install/uav_task_alloc/lib/uav_task_alloc/demo \
		--scenario config/scenarios/$(SCENARIO).yaml --out out/$(SCENARIO) --limit 200

test: build browser linted collected
	@echo '== pytest, $(WORKERS) at a time' && $(RUN) && REQUIRE_ROS=1 python3 -m pytest -n $(WORKERS) --dist worksteal --durations 15

# Chromium, where there is none
browser: .ros/.made
	@tools/browser.sh .ros > /dev/null

linted: install/.built
	@echo '== ruff, mypy' && .ros/bin/ruff check . && .ros/bin/mypy

# Collecting compiles the tests once for all workers, without waiting for the kernels: without numba
# most imports fail, after the compilation. Pytest collects all again, and shows what fails then.
collected: install/.built
	@$(RUN) && NUMBA_DISABLE_JIT=1 REQUIRE_ROS=1 python3 -m pytest --collect-only > /dev/null 2>&1 || :

# Line coverage of the package without nodes; below the floor of setup.cfg it fails
coverage: build
	@.ros/bin/python -m pip install -q pytest-cov
	@$(RUN) && python3 -m pytest -n $(WORKERS) --dist worksteal --ignore test/nodes --ignore test/sitl \
		--cov --cov-report term:skip-covered --cov-report html:out/coverage

# After this `source install/setup.bash` is all a shell needs.
build: install/.built install/.compiled

.ros/.made: tools/ros_env/setup.sh tools/ros_env/requirements.txt tools/ros_env/python.txt
	@echo '== ROS 2 Jazzy and Python packages into .ros/ (once, up to a minute)'
	@$(STOP); tools/ros_env/setup.sh .ros
	@touch $@

install/.built: .ros/.made setup.py setup.cfg package.xml colcon_defaults.yaml \
		$(wildcard resource/* msg_defs/* msg_defs/*/* launch/* config/*.yaml config/*.rviz config/scenarios/*)
	@echo '== colcon build (about a minute when messages changed)'
	@$(STOP); mkdir -p log && $(ENV) && python3 -m colcon build --symlink-install > log/make_build.txt 2>&1 \
		|| { tail -n 40 log/make_build.txt; exit 1; }
	@touch $@

install/.compiled: .ros/.made $(wildcard uav_task_alloc/*.py uav_task_alloc/*/*.py uav_task_alloc/*/*/*.py)
	@echo '== kernels'
	@$(STOP); $(ENV) && python3 -m uav_task_alloc compile
	@mkdir -p install && touch $@

# The generated files: config/*.yaml, docs/parameters.md, the index of docs/architecture.md
docs: build
	@$(RUN) && python3 -m uav_task_alloc params --write && python3 tools/docs/file_index.py

# The docs as a site in out/site; a broken link or a public name without a docstring fails
site: build
	@.ros/bin/python -m pip install -q myst-parser sphinx
	@$(RUN) && PYTHONPATH=".:$$PYTHONPATH" python3 -m sphinx -W --keep-going -q -b html docs out/site
	@echo '== open out/site/index.html'

clean:
	rm -rf .ros build install log out
