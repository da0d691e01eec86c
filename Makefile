# Everything that a target needs goes into a virtual environment beside this file; run again, a
# target reuses it. PYTHON=... chooses the interpreter.

VENV := .venv
ROS := .venv-ros
FLOOR_VERSIONS := .ci/ubuntu_24.04.txt
# The checks run with these versions; a user gets the newest that are allowed.
LOCKED := $(if $(CI),--constraint .ci/lock.txt)
# In the order that conftest.py gives: files of few tests are often long, and none of these comes
# last so. Tests that wait for other processes leave room for a third worker on two cores.
# A test that hangs fails after 15 minutes, with the stack of each thread.
FILES := --dist loadfile --no-loadscope-reorder --timeout 900
PARALLEL := -n 3 $(FILES)
# The suite of the product; 'make check' runs the examples, 'make test-evidence' what takes long.
SUITE := -m "not evidence" --ignore=test/test_docs.py --ignore=test/test_examples.py test
FAULTS_ON_ROS := $(wildcard benchmarks/test/bench/test_*fault*.py benchmarks/test/bench/test_pipes.py) \
  benchmarks/test/bench/test_real_time.py
INPUTS := setup.py pyproject.toml benchmarks/pyproject.toml package.xml resource/executables.txt

# Tests start many processes, each of which would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE
# As the commands do: a process works on each core, and more threads would wait for each other.
export OMP_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help demo test test-suite test-nodes test-ros test-faults test-evidence check docs clean

help:
	@echo "make demo           scan a simulated scanner without and with compensation; report in demo/"
	@echo "make test           run the test suite of the product, with the nodes where ROS can be had"
	@echo "make test-ros       run the suite, and whole scans of nodes, on a ROS 2 made from wheels, with"
	@echo "                    the oldest versions that are supported of what the package needs"
	@echo "make test-faults    inject faults into scans of nodes, on the same ROS"
	@echo "make test-evidence  run the tests of the benchmarks, and those of the product that take long"
	@echo "make check          run the linter, the type checker and the examples, and build the site"
	@echo "make docs           build the documentation site in site/"
	@echo "make clean          remove what these made"

demo: $(VENV)/installed
	$(VENV)/bin/afm-scan demo --out demo

test: test-suite
	@lacking=$$(scripts/jazzy_by_pip.sh --lacking); if [ -z "$$lacking" ]; then \
	  $(MAKE) --no-print-directory test-nodes; \
	else echo "make test: the tests of nodes were left out: this machine lacks $$lacking"; fi

test-suite: $(VENV)/ready
	$(VENV)/bin/python -m pytest $(PARALLEL) $(SUITE)

test-nodes: $(ROS)/ready
	$(call pytest_on_ros,-n 2 -m "not evidence and not long" test/nodes)

# This ROS has numpy, scipy and the others in Ubuntu 24.04's versions, the oldest that are supported.
# 'make test' tests the nodes on it, all but what takes whole scans. Where ROS has them, they are
# tested on its other usual middleware too.
test-ros: $(ROS)/ready
	$(call pytest_on_ros,-n 3 --hypothesis-profile=floor $(SUITE) --ignore=test/nodes)
	$(call pytest_on_ros,-n 2 -m "long and not evidence" test/nodes)
	@if $(ROS)/run python -c "import ctypes; ctypes.CDLL('librmw_cyclonedds_cpp.so')" 2>/dev/null; then \
	  export RMW_IMPLEMENTATION=rmw_cyclonedds_cpp; $(call pytest_on_ros,-n 2 -m "not evidence" test/nodes); \
	else echo "make test-ros: this ROS has no rmw_cyclonedds_cpp: the nodes were tested on Fast DDS alone"; fi

test-faults: $(ROS)/ready
	$(call pytest_on_ros,-n 2 -m evidence test/nodes)
	export PYTHONPATH=$(CURDIR)/benchmarks; $(call pytest_on_ros,-n 2 $(FAULTS_ON_ROS))

# Tests that need ROS are skipped without it. pytest fails where it finds no test. The cache of
# compiled loops is this numba's own.
pytest_on_ros = $(ROS)/run python -c "import rclpy, afm_scan_ros.msg" && \
	  NUMBA_CACHE_DIR=$(CURDIR)/$(ROS)/numba $(ROS)/run python -m pytest $(FILES) $(1)

test-evidence: $(VENV)/ready
	$(VENV)/bin/python -m pytest $(PARALLEL) -m evidence test
	$(VENV)/bin/python -m pytest $(PARALLEL) benchmarks/test

check: docs
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/python -m pytest -n 2 test/test_docs.py test/test_examples.py

docs: $(VENV)/ready
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/python -m mkdocs build --strict --quiet

clean:
	rm -rf $(VENV) $(ROS) .venv-uv demo build site *.egg-info

# What the package itself needs.
$(VENV)/installed: $(INPUTS)
	@for p in $(PYTHON) python3 python3.13 python3.12 python3.11; do \
	  test -z "$$found" && $$p -c "import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))" \
	    2>/dev/null && found=$$p; \
	done; \
	test -n "$$found" || { echo "No Python 3.11 to 3.14 found: install one, or name it:" \
	  "make PYTHON=/path/to/python3" >&2; exit 1; }; \
	echo "Making $(VENV) with $$($$found --version)"; \
	rm -rf $(VENV); \
	$$found -m venv $(VENV) || { echo "Python's venv module is incomplete;" \
	  "on Debian and Ubuntu: sudo apt install python3-venv" >&2; rm -rf $(VENV); exit 1; }
	@echo "Installing afm_scan_ros and what it needs into $(VENV) (once, half a minute)"
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check $(LOCKED) --editable .
	@$(VENV)/bin/python -m compileall -q -j 0 afm_scan_ros
	@touch $@

# And what tests, benchmarks and documents need.
$(VENV)/ready: $(VENV)/installed
	@echo "Installing what the tests and the documents need into $(VENV) (once, a minute and a half)"
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check $(LOCKED) --editable ".[docs,test]" --editable benchmarks
	@$(VENV)/bin/python -m compileall -q -j 0 benchmarks/afm_scan_bench
	@touch $@

# Files that are edited need no rebuild: they are linked.
PACKAGE := $(shell find afm_scan_ros config launch msg -type d -not -name __pycache__) $(wildcard msg/*)
$(ROS)/ready: $(INPUTS) $(FLOOR_VERSIONS) CMakeLists.txt scripts/jazzy_by_pip.sh $(PACKAGE)
	scripts/jazzy_by_pip.sh $(ROS)
	@touch $@
