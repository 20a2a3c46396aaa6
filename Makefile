# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
#
# make demo    the shipped drives through the real node, and a blind trial: reports, key numbers
# make test    all but the slow tests
# make lint    ruff and mypy
# make docs    the site (site/index.html), warnings are errors
# make clean   remove what these made
#
# Each sets up what it needs in a virtual environment (.venv) with pinned versions, once.

PYTHON ?= python3
VENV ?= .venv
PYTEST_ARGUMENTS ?= --numprocesses auto --dist loadfile --no-loadscope-reorder
# With a sourced Jazzy, its own rclpy is used, and the numpy that it was built for.
ifdef ROS_DISTRO
RUNTIME ?= requirements/oldest.txt
ROS ?=
else
RUNTIME ?= requirements/runtime.txt
ROS ?= -r requirements/ros.txt
endif

BIN := $(VENV)/bin
PINS := $(wildcard requirements/*.txt)
# Modules are compiled when they are first imported: half of the time of a set-up.
PIP := $(BIN)/python -m pip --disable-pip-version-check install -qq --no-compile
# Tests and demo stay on this machine.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
# Compiled tests are kept: each worker would compile all of them anew, for five seconds.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo test lint docs clean
help:
	@sed -n 's/^# \(make .*\)/\1/p' Makefile

demo: $(VENV)/.runtime
	@$(BIN)/python -m wheel_terra_estimator.cli.main demo --overwrite

test: $(VENV)/.test
	$(BIN)/python -m pytest -m 'not slow' $(PYTEST_ARGUMENTS)

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/.docs
	$(BIN)/python -m mkdocs build --strict
	@echo 'site/index.html'

$(VENV)/.docs: $(VENV)/.runtime
	@$(PIP) -r requirements/docs.txt
	@touch $@

$(VENV)/.runtime: $(PINS) setup.py pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	  { echo 'Python 3.10 or newer is needed; name it: make PYTHON=python3.12 ...'; exit 1; }
	@echo 'Setting up $(VENV) (downloads once) ...'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(PIP) -r $(RUNTIME) $(ROS)
	@$(PIP) --no-deps --editable .
	@touch $@

$(VENV)/.test: $(VENV)/.runtime
	@$(PIP) -r $(RUNTIME) $(ROS) -r requirements/test.txt
	@touch $@

clean:
	rm -rf $(VENV) site demo_output build install log *.egg-info
