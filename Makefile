# Everything that a developer runs, each in an environment of the project's own under .venv/.
# "make" lists the targets.

# Which Python each supported Blender has inside; requirements/blender-*.txt pin the rest.
BLENDER_VERSIONS := 4.5 5.0 5.1 5.2
PYTHON_OF_4.5 := 3.11
PYTHON_OF_5.0 := 3.11
PYTHON_OF_5.1 := 3.13
PYTHON_OF_5.2 := 3.13

# The newest Blender that runs under Python 3.11, or the newest of all where only 3.13 is there.
DEFAULT_VERSION := $(if $(shell tools/find_python 3.11 2>&1 >/dev/null),5.2,5.0)
BLENDER_VERSION ?= $(DEFAULT_VERSION)


ENV := .venv/bpy-$(BLENDER_VERSION)
PY := $(ENV)/bin/python
# Lint and docs need no Blender, hence an environment without it.
DEV := .venv/dev/bin
PIP_INSTALL := -m pip install -qq --disable-pip-version-check -c requirements/wheels.txt

PYTEST_ARGS ?=
TESTS ?= tests
WORKERS ?= 2

BENCH := build/bench/env
BENCH_ARGS ?=
FIGURES_ARGS ?=
RELEASE_ARGS ?=
FUZZ_SECONDS ?= 120

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup system-packages demo test test-all test-others test-farm test-gui benchmark bench-fidelity \
	bench-reflections bench-flicker bench-speed test-slurm fuzz figures scenes extension release lint format docs \
	clean

help:  ## list these targets
	@echo "make TARGET [BLENDER_VERSION=$(BLENDER_VERSION)]   (one of $(BLENDER_VERSIONS))"
	@sed -n 's/^\([a-z-]*\):.*##  *\(.*\)/  \1\t\2/p' Makefile | expand -t 22

# One rule for each Blender: .venv/bpy-X.Y/.stamp is newer than the requirements that it was made from.
define environment
.venv/bpy-$(1)/.stamp: requirements/core.txt requirements/test.txt requirements/figures.txt requirements/blender-$(1).txt requirements/wheels.txt
	@python=$$$$(tools/find_python $$(PYTHON_OF_$(1))) && \
	echo "Making the environment of Blender $(1) (a download of about 400 MB the first time)" && \
	"$$$$python" -m venv .venv/bpy-$(1) && \
	.venv/bpy-$(1)/bin/python $$(PIP_INSTALL) $$(patsubst %,-r %,$$(filter-out %/wheels.txt,$$^)) && \
	touch $$@
endef
$(foreach version,$(BLENDER_VERSIONS),$(eval $(call environment,$(version))))

.venv/dev/.stamp: requirements/core.txt requirements/test.txt requirements/dev.txt requirements/docs.txt requirements/wheels.txt
	@python=$$(tools/find_python $(PYTHON_OF_$(DEFAULT_VERSION))) && \
	echo "Making the environment for lint and docs" && \
	"$$python" -m venv .venv/dev && \
	.venv/dev/bin/python $(PIP_INSTALL) $(patsubst %,-r %,$(filter-out %/wheels.txt,$^)) && \
	touch $@

setup: $(ENV)/.stamp .venv/dev/.stamp .venv/farm/.stamp  ## make the environments for tests, lint and docs

system-packages: $(ENV)/.stamp  ## print the Debian packages that bpy still needs here
	@$(PY) tools/check_bpy.py --packages

demo: $(ENV)/.stamp  ## render a sample scene and refocus it, into build/demo
	@$(PY) tools/check_bpy.py
	$(PY) -m sample_scenes.demo --output build/demo

figures: $(ENV)/.stamp  ## draw the papers' figures and tables again, into build/figures
	@$(PY) tools/check_bpy.py
	$(PY) -m figures $(FIGURES_ARGS)

# Files of the oldest Blender open in all.
scenes: .venv/bpy-4.5/.stamp  ## save the sample scenes as .blend files
	.venv/bpy-4.5/bin/python -m sample_scenes

test: $(ENV)/.stamp .venv/farm/.stamp  ## run the tests under one Blender
	@$(PY) tools/check_bpy.py
	$(PY) -m pytest $(TESTS) --ignore=tests/gui -n $(WORKERS) --dist loadgroup $(PYTEST_ARGS)

# The others come first, so that the run ends with the default's result.
test-all:  ## run the tests under every supported Blender
	@status=0; $(MAKE) --no-print-directory test-others || status=1; \
	$(MAKE) --no-print-directory test || status=1; exit $$status

# The core knows no Blender, and 4.5 and 5.0 have one Python and numpy, 5.1 and 5.2 another. What the figures show
# is up to the core too: one Blender renders them.
FIGURE_TESTS := $(wildcard tests/blender/test_*_figures.py) tests/blender/test_night_street.py tests/blender/test_still_life.py

# What hardly differs between Blenders and takes its time.
LONG_TESTS := $(addprefix tests/blender/,test_kernels.py test_memory.py test_writing.py test_release_zip.py)
BY_DEFAULT_ONLY := tests/farm tests/core/test_writing.py $(FIGURE_TESTS)

# Two at a time: much of a run is compiling, which takes one core. Those without the core's tests have one worker.
test-others:  ## the same, leaving out the Blender that "make test" uses
	@$(MAKE) --no-print-directory --keep-going --jobs=2 --output-sync=target \
		$(addprefix test-under-,$(filter-out $(BLENDER_VERSION),$(BLENDER_VERSIONS)))

test-under-%:
	@echo "== Blender $*"; \
	if ! reason=$$(tools/find_python $(PYTHON_OF_$*) 2>&1 >/dev/null); then echo "skipped: $$reason"; exit; fi; \
	case $* in \
		4.5|5.1) set -- TESTS="tests/blender $(addprefix --ignore=,$(FIGURE_TESTS) $(LONG_TESTS))" WORKERS=1 ;; \
		*) set -- TESTS="tests $(addprefix --ignore=,$(BY_DEFAULT_ONLY))" ;; esac; \
	$(MAKE) --no-print-directory test BLENDER_VERSION=$* "$$@" || \
	{ echo "Tests failed under Blender $*." >&2; exit 1; }

test-gui: $(ENV)/.stamp  ## run the tests that need a window: make test-gui BLENDER=/path/to/blender
	@if [ -z "$$BLENDER" ]; then echo "Name a Blender with a window: make test-gui BLENDER=/path/to/blender" >&2; exit 1; fi
	$(PY) -m pytest tests/gui $(PYTEST_ARGS)

.venv/farm/.stamp: requirements/farm.txt
	@python=$$(tools/find_python $(PYTHON_OF_$(DEFAULT_VERSION))) && \
	echo "Making the environment of the farm's tests" && \
	"$$python" -m venv .venv/farm && \
	.venv/farm/bin/python -m pip install -qq --disable-pip-version-check -r $< && \
	touch $@

test-farm: $(ENV)/.stamp .venv/farm/.stamp  ## run the jobs of farm engines: OpenJD for real, the others' descriptions
	$(PY) -m pytest tests/farm --ignore=tests/farm/slurm $(PYTEST_ARGS)

test-slurm: $(ENV)/.stamp .venv/farm/.stamp  ## run an animation on a real Slurm cluster in namespaces of this machine, as root
	POTMESIL_SLURM=1 $(PY) -m pytest tests/farm/slurm $(PYTEST_ARGS)

# The benchmarks run under Blender 5.2; what only they need stays out of its environment.
$(BENCH)/.stamp: .venv/bpy-5.2/.stamp requirements/bench.txt
	@echo "Making the environment of the benchmarks" && \
	.venv/bpy-5.2/bin/python -m venv $(BENCH) && \
	echo ../../../../../../.venv/bpy-5.2/lib/python$(PYTHON_OF_5.2)/site-packages \
		> $(BENCH)/lib/python$(PYTHON_OF_5.2)/site-packages/bpy.pth && \
	$(BENCH)/bin/python $(PIP_INSTALL) -r requirements/bench.txt && \
	touch $@

bench-fidelity: $(BENCH)/.stamp  ## measure depth of field against Cycles, Defocus and GEGL, into build/bench/lens
	$(BENCH)/bin/python benchmarks/lens_fidelity.py $(BENCH_ARGS)

bench-reflections: $(BENCH)/.stamp  ## measure reflections against Cycles and Blender's nodes, into build/bench/reflections
	$(BENCH)/bin/python benchmarks/reflection_fidelity.py $(BENCH_ARGS)

bench-flicker: $(BENCH)/.stamp  ## measure flicker in a focus pull and a camera move, into build/bench/flicker
	$(BENCH)/bin/python benchmarks/flicker.py $(BENCH_ARGS)

# BLENDER names the Blender whose nodes are timed; without it that is the module bpy.
bench-speed: $(BENCH)/.stamp  ## measure speed and memory beside Defocus, Vector Blur, GEGL and Cycles, into build/bench/speed
	$(BENCH)/bin/python benchmarks/speed.py $(BENCH_ARGS)

benchmark: $(BENCH)/.stamp  ## measure motion blur against Cycles and Vector Blur, into build/bench/motion
	$(BENCH)/bin/python benchmarks/motion_fidelity.py $(BENCH_ARGS)

# Fuzzing has an environment of its own too; the package has no wheels for every Python.
.venv/fuzz/.stamp: requirements/core.txt requirements/fuzz.txt requirements/wheels.txt
	@python=$$(tools/find_python 3.11) && \
	"$$python" -m venv .venv/fuzz && \
	.venv/fuzz/bin/python $(PIP_INSTALL) -r requirements/core.txt -r requirements/fuzz.txt && \
	touch $@

fuzz: .venv/fuzz/.stamp  ## fuzz what reads files for FUZZ_SECONDS, into build/fuzz
	.venv/fuzz/bin/python tools/fuzz.py json --seconds $$(($(FUZZ_SECONDS) / 4))
	.venv/fuzz/bin/python tools/fuzz.py samples --seconds $$(($(FUZZ_SECONDS) * 3 / 4)) \
		$(if $(wildcard ../shared/data/exr-damaged),--more ../shared/data/exr-damaged)

extension: $(ENV)/.stamp  ## build and validate the extension without wheels, into dist/
	$(PY) tools/build_extension.py --output dist

# "--allow-unreleased" tries what a release would be. The zips are tried under each Blender that is set up.
release: $(ENV)/.stamp  ## build, validate and install the release zips, with checksums and bills of materials
	@$(PY) tools/check_bpy.py
	@$(PY) tools/release.py $(RELEASE_ARGS)

lint: .venv/dev/.stamp  ## ruff and mypy
	@status=0; for check in "ruff check" "ruff format --check" mypy; do \
		echo "$$check"; $(DEV)/$$check || status=1; done; exit $$status

format: .venv/dev/.stamp  ## mend what ruff can mend by itself
	$(DEV)/ruff check --fix
	$(DEV)/ruff format

docs: .venv/dev/.stamp  ## build the documentation into build/docs
	$(DEV)/sphinx-build -E -W --keep-going -q docs build/docs

clean:  ## remove what was built; the environments under .venv stay
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage htmlcov
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
