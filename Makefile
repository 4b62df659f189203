# The same few commands for people and for CI. Each sets up all it needs.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
WORKERS := $(shell echo $$(($$(nproc 2>/dev/null || echo 2) + 1)))
PYTEST := $(BIN)/python -m pytest -q --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder
SECONDS := 600
MINUTES := 60
READERS := obj ply gltf tifxyz images depths captures cameras lasers clouds meshes foreign_cameras usd packed_gltf phone_photos

.PHONY: demo test quick lint bench view fuzz soak docs site dist wheels-check lowest audit clean

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --group dev --editable .
	$(BIN)/python -m pip install --quiet --pre "meshoptimizer>=0.2.20a0" 2>/dev/null || echo "no compiler: glTF packed with meshopt is not tested"
	touch $@

demo: $(READY)  ## scan a bound page virtually, restore it, show the numbers; see planish-demo/
	$(BIN)/planish demo book -o planish-demo

# One process more than cores, as tests wait for servers, browsers and clusters now and then. Libraries that would share out work among cores once more only wait for each other. Tests
# start many programs; where those may not keep their bytecode, each compiles all of planish anew.
test quick: export OPENBLAS_NUM_THREADS := 1
test quick: export OMP_THREAD_LIMIT := 1
test quick: export PYTHONDONTWRITEBYTECODE :=

test: $(READY)  ## every test and every example in the docstrings, on all cores
	$(PYTEST)

quick: $(READY)  ## the tests that take less than half a second, some of every room
	$(PYTEST) -m "not slow"

lint: $(READY)  ## style, imports that point one way, types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy

bench: $(READY)  ## the figures of docs/benchmarks-*.md, anew (half an hour)
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	$(BIN)/python benchmarks/run_all.py

fuzz: $(READY)  ## every reader fed with damaged files: two and a half hours (SECONDS=60: a quarter of one)
	$(BIN)/python -m pip install --quiet --group fuzz
	for reader in $(READERS); do $(BIN)/python fuzz/$$reader.py -max_total_time=$(SECONDS) || exit 1; done

soak: $(READY)  ## an hour of mixed jobs, kills and damaged files, with memory and open files watched (MINUTES=60)
	$(BIN)/python benchmarks/soak.py --minutes $(MINUTES)

view:  ## the program of the page to look at, anew from its sources (needs node)
	cd src/planish/view/web && npm ci --ignore-scripts --no-audit --no-fund && npm run check && npm run build

docs: $(READY)  ## docs/cli*.md, the manual page, the schema and the pictures, anew
	$(BIN)/python docs/make_cli.py
	$(BIN)/python docs/make_man.py
	$(BIN)/python docs/make_schema.py
	$(BIN)/python docs/make_picture.py
	$(BIN)/python docs/make_solver_picture.py
	$(BIN)/python docs/make_animation.py

site: $(READY)  ## the documentation as a site in build/site/, without a warning
	$(BIN)/python -m pip install --quiet --group docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --site-dir build/site

dist: $(READY)  ## the wheel and the source distribution, tried in an environment of their own
	rm -rf dist
	$(BIN)/python -m build --quiet
	.ci/try_wheel dist/planish-*.whl

wheels-check:  ## does every dependency come as a wheel, on Windows, macOS and Linux, for Python 3.11 to 3.13?
	.ci/check_wheels ocr usd photos packed clouds points web plot

lowest:  ## the quick tests with the oldest versions that pyproject allows, kernels compiled anew
	$(PYTHON) -m venv $(VENV)-lowest
	$(VENV)-lowest/bin/python -m pip install --quiet uv
	$(VENV)-lowest/bin/uv pip install --quiet --python $(VENV)-lowest/bin/python --resolution lowest-direct \
		--only-binary :all: --group dev --editable .
	NUMBA_CACHE_DIR=$(VENV)-lowest/kernels $(VENV)-lowest/bin/python -m pytest -q -m "not slow" -p no:warnings

audit:  ## known faults of what an installation brings along, and a list of it (SBOM) in build/
	$(PYTHON) -m venv $(VENV)-audit
	$(VENV)-audit/bin/python -m pip install --quiet '.[web,photos,clouds,points,ocr]'
	$(VENV)-audit/bin/python -m pip freeze --exclude planish > $(VENV)-audit/requirements.txt
	$(PYTHON) -m venv $(VENV)-audit/tools
	$(VENV)-audit/tools/bin/python -m pip install --quiet pip-audit cyclonedx-bom
	mkdir -p build
	$(VENV)-audit/tools/bin/cyclonedx-py environment $(VENV)-audit/bin/python --output-file build/planish.sbom.json
	$(VENV)-audit/tools/bin/pip-audit --strict --no-deps --disable-pip --requirement $(VENV)-audit/requirements.txt

clean:
	rm -rf $(VENV) $(VENV)-lowest $(VENV)-audit build dist .pytest_cache .ruff_cache .mypy_cache
