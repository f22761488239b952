# `make dataset` and `make test` do all the set-up on a fresh Debian or Ubuntu machine.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo)
APT_INSTALL := $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends
SOURCES := $(shell find fastgen shaders assets setup.cfg pyproject.toml -type f -not -path '*/__pycache__/*')

.PHONY: setup dataset test lint clean system glslang chromium

setup: $(VENV)/.dev

# libGL libraries that rendering without a screen needs; libosmesa6 is gone from the newest releases
system:
	@if ldconfig -p | grep -q libEGL.so.1 && ldconfig -p | grep -q libOSMesa && \
	    $(PYTHON) -c 'import ensurepip' 2>/dev/null; then :; \
	elif command -v apt-get >/dev/null; then \
	    if [ "$$(id -u)" != 0 ] && [ -z "$(SUDO)" ]; then \
	        echo 'As root, run: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libosmesa6 python3-venv'; \
	        exit 1; fi; \
	    $(SUDO) apt-get update -q && \
	    $(APT_INSTALL) libegl1 libegl-mesa0 libgl1-mesa-dri python3-venv && \
	    { $(APT_INSTALL) libosmesa6 || echo 'no libosmesa6 in this release: the osmesa backend will be missing'; }; \
	else echo 'Install Mesa (EGL, DRI drivers, OSMesa) with your package manager.'; fi

# GLSL's reference compiler, for the tests alone
glslang: | system
	@if command -v glslangValidator >/dev/null; then :; \
	elif command -v apt-get >/dev/null; then \
	    if [ "$$(id -u)" != 0 ] && [ -z "$(SUDO)" ]; then \
	        echo 'As root, run: apt-get install glslang-tools'; exit 1; fi; \
	    $(SUDO) apt-get update -q && $(APT_INSTALL) glslang-tools; \
	else echo 'Install glslangValidator with your package manager.'; exit 1; fi

# the browser of the tests of `fastgen studio`
chromium: | system
	@if command -v chromium >/dev/null || command -v google-chrome >/dev/null; then :; \
	elif command -v apt-get >/dev/null; then \
	    if [ "$$(id -u)" != 0 ] && [ -z "$(SUDO)" ]; then \
	        echo 'As root, run: apt-get install chromium'; exit 1; fi; \
	    $(SUDO) apt-get update -q && $(APT_INSTALL) chromium; \
	else echo 'Install Chromium with your package manager.'; exit 1; fi

$(BIN)/python: | system
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo 'fastgen needs Python 3.11 or later: set PYTHON to one'; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(SOURCES) | $(BIN)/python
	$(BIN)/pip install --quiet --disable-pip-version-check .
	@touch $@

.PHONY: install docs

install: $(VENV)/.installed

# what the tests need is much larger than the package: PyTorch, Ray and other libraries' readers
$(VENV)/.dev: $(SOURCES) | $(BIN)/python
	$(BIN)/pip install --quiet --disable-pip-version-check '.[dev]'
	@touch $(VENV)/.installed $@

dataset: $(VENV)/.installed
	$(BIN)/fastgen generate dataset --images 48 --size 640x640
	@echo 'Look at dataset/contact_sheet.png'

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

# A crashed worker ends the run: pytest-xdist would assign all its files again, even finished ones,
# and wait for these forever. Ray leaves threads in the process that used it and replaces Python's
# handlers of fatal signals, so its tests have a process of their own.
test: glslang chromium lint
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart=0 --ignore=tests/test_ray.py
	$(BIN)/pytest tests/test_ray.py

docs: setup
	$(BIN)/mkdocs build
	@echo 'Open build/docs/index.html; search needs a server: $(PYTHON) -m http.server -d build/docs'

clean:
	rm -rf $(VENV) build dist *.egg-info dataset
