# setup: .venv    bake: the main job    test, check: what CI runs    package: the extension's zips    chart: benchmarks
# `make bake SCENE=path.blend ARGS="--error .02"` bakes any scene; `make test ARGS="-k furnace"` runs some tests.

PYTHON ?= python3.11
VENV := .venv
RUN := $(VENV)/bin/python
STAMP := $(VENV)/.ready
EXAMPLE := examples/cornell_box.blend
SCENE ?= $(EXAMPLE)
ARGS ?=
OUT := out/bake

.PHONY: setup bake test check package chart clean
.DELETE_ON_ERROR:

setup: $(STAMP)

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(STAMP): tools/requirements.txt pyproject.toml | $(VENV)/bin/python
	$(RUN) -m pip install --quiet --requirement tools/requirements.txt
	$(RUN) -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

$(EXAMPLE): examples/cornell_box.py | $(STAMP)
	$(RUN) $< $@

# Exit code 4: the wanted error was not reached, but the results are written, so there is a picture; make fails all the same.
bake: $(STAMP) $(SCENE)
	@code=0; $(RUN) -m radiosity bake "$(SCENE)" --output $(OUT) --save $(OUT)/baked.blend \
	    --report $(OUT)/report.json $(ARGS) || code=$$?; \
	if [ $$code -eq 0 ] || [ $$code -eq 4 ]; then \
	    $(RUN) tools/picture.py $(OUT)/baked.blend $(OUT)/picture.png || exit 1; \
	    echo "picture     $(OUT)/picture.png"; \
	fi; exit $$code

test: $(STAMP)
	$(RUN) -m pytest $(ARGS)

# mypy sees the root under its library name, `radiosity`, through a link: relative imports then have a parent.
check: $(STAMP)
	$(RUN) -m ruff check .
	mkdir -p build/types && ln -sfn ../.. build/types/radiosity
	cd build/types && ../../$(RUN) -m mypy --config-file ../../pyproject.toml radiosity
	$(RUN) -m pytest -q tests/test_import_direction.py

package: $(STAMP)
	$(RUN) tools/wheels.py
	$(RUN) tools/package.py

chart: $(STAMP)
	$(RUN) benchmarks/chart.py $(ARGS)

clean:
	rm -rf out build dist
