# Everything that a target needs goes into a virtual environment beside this file; run again, a
# target reuses it. PYTHON=... chooses the interpreter.

VENV := .venv
FLOOR := .venv-floor
ROS := .venv-ros
FLOOR_VERSIONS := .ci/ubuntu_24.04.txt
# In the order that conftest.py gives: files of few tests are often long, and none of these comes
# last so. Tests that wait for other processes leave room for a third worker on two cores.
PARALLEL := -n 3 --dist loadfile --no-loadscope-reorder
# The suite of the product; 'make check' runs the examples, 'make test-evidence' what takes long.
SUITE := $(PARALLEL) -m "not evidence" --ignore=test/test_docs.py --ignore=test/test_examples.py test
# These exchange blocks in real time and compute nothing; other tests of commands do so as well.
EXCHANGES := --ignore=test/drivers --ignore=test/nodes --ignore=test/cli/test_calibrate.py
# What starts nodes, and all that a command does otherwise where there is ROS. Each worker has a
# domain of its own.
ON_ROS := test/nodes test/drivers test/cli test/test_launch.py
FAULTS_ON_ROS := $(wildcard benchmarks/test/bench/test_*fault*.py benchmarks/test/bench/test_pipes.py) \
  benchmarks/test/bench/test_real_time.py
INPUTS := setup.py pyproject.toml benchmarks/pyproject.toml package.xml resource/executables.txt

# Tests start many processes, each of which would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test test-suite test-nodes test-ros test-faults test-evidence check docs test-floor clean

help:
	@echo "make demo           scan a simulated scanner without and with compensation; report in demo/"
	@echo "make test           run the test suite of the product, with the nodes where ROS can be had"
	@echo "make test-ros       run the tests of nodes, drivers and commands on a ROS 2 made from wheels"
	@echo "make test-faults    inject faults into scans of nodes, on the same ROS"
	@echo "make test-evidence  run the tests of the benchmarks, and those of the product that take long"
	@echo "make check          run the linter, the type checker and the examples, and build the site"
	@echo "make docs           build the documentation site in site/"
	@echo "make test-floor     run the suite with the oldest supported versions of what it needs"
	@echo "make clean          remove what these made"

demo: $(VENV)/ready
	$(VENV)/bin/afm-scan demo --out demo

test: test-suite
	@lacking=$$(scripts/jazzy_by_pip.sh --lacking); if [ -z "$$lacking" ]; then \
	  $(MAKE) --no-print-directory test-nodes; \
	else echo "make test: the tests of nodes were left out: this machine lacks $$lacking"; fi

test-suite: $(VENV)/ready
	$(VENV)/bin/python -m pytest $(SUITE)

test-nodes: $(ROS)/ready
	$(call pytest_on_ros,-m "not evidence" test/nodes)

# Where ROS has them, the nodes are tested on its other usual middleware too.
test-ros: $(ROS)/ready
	$(call pytest_on_ros,-m "not evidence" $(ON_ROS))
	@if $(ROS)/run python -c "import ctypes; ctypes.CDLL('librmw_cyclonedds_cpp.so')" 2>/dev/null; then \
	  export RMW_IMPLEMENTATION=rmw_cyclonedds_cpp; $(call pytest_on_ros,-m "not evidence" test/nodes); \
	else echo "make test-ros: this ROS has no rmw_cyclonedds_cpp: the nodes were tested on Fast DDS alone"; fi

test-faults: $(ROS)/ready
	$(call pytest_on_ros,-m evidence test/nodes)
	export PYTHONPATH=$(CURDIR)/benchmarks; $(call pytest_on_ros,$(FAULTS_ON_ROS))

# Tests that need ROS are skipped without it. pytest fails where it finds no test.
pytest_on_ros = $(ROS)/run python -c "import rclpy, afm_scan_ros.msg" && \
	  $(ROS)/run python -m pytest -n 2 --dist loadfile --no-loadscope-reorder $(1)

test-evidence: $(VENV)/ready
	$(VENV)/bin/python -m pytest $(PARALLEL) -m evidence test
	$(VENV)/bin/python -m pytest $(PARALLEL) benchmarks/test

check: docs
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/python -m pytest test/test_docs.py test/test_examples.py

docs: $(VENV)/ready
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/python -m mkdocs build --strict --quiet

test-floor: $(FLOOR)/ready
	NUMBA_CACHE_DIR=$(FLOOR)/numba $(FLOOR)/bin/python -m pytest --hypothesis-profile=floor $(EXCHANGES) $(SUITE)

clean:
	rm -rf $(VENV) $(FLOOR) $(ROS) .venv-uv demo build site *.egg-info

# $(call environment,FOLDER,NEWEST MINOR VERSION OF PYTHON 3,FURTHER REQUIREMENTS)
define environment
	@for p in $(PYTHON) python3 python3.13 python3.12 python3.11; do \
	  test -z "$$found" && $$p -c "import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, $(2)))" \
	    2>/dev/null && found=$$p; \
	done; \
	test -n "$$found" || { echo "No Python 3.11 to 3.$(2) found: install one, or name it:" \
	  "make PYTHON=/path/to/python3" >&2; exit 1; }; \
	echo "Making $(1) with $$($$found --version)"; \
	rm -rf $(1); \
	$$found -m venv $(1) || { echo "Python's venv module is incomplete;" \
	  "on Debian and Ubuntu: sudo apt install python3-venv" >&2; rm -rf $(1); exit 1; }
	@echo "Installing afm_scan_ros and what it needs into $(1) (once, about a minute)"
	@$(1)/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[docs,test]" --editable benchmarks $(3)
	@$(1)/bin/python -m compileall -q -j 0 afm_scan_ros benchmarks/afm_scan_bench
	@touch $@
endef

$(VENV)/ready: $(INPUTS)
	$(call environment,$(VENV),14)

$(FLOOR)/ready: $(INPUTS) $(FLOOR_VERSIONS)
	$(call environment,$(FLOOR),12,--constraint $(FLOOR_VERSIONS))

# Files that are edited need no rebuild: they are linked.
PACKAGE := $(shell find afm_scan_ros config launch msg -type d -not -name __pycache__) $(wildcard msg/*)
$(ROS)/ready: $(INPUTS) $(FLOOR_VERSIONS) CMakeLists.txt scripts/jazzy_by_pip.sh $(PACKAGE)
	scripts/jazzy_by_pip.sh $(ROS)
	@touch $@
