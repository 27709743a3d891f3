# Targets for users and contributors. `make` lists them.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help demo test check install install-dev test-quick test-cpus test-reliability test-soak test-s3 test-torch test-trackeval test-readers test-fiftyone test-detector test-browser test-gpu fuzz bench bench-long bench-estimates presets gallery tables paper attack-study attack-goals evidence-pictures lock verify golden requirements clean test-ray bench-ray

# The tests start about a hundred processes; each starts half a second sooner if compiled modules are kept.
unexport PYTHONDONTWRITEBYTECODE

VENV ?= .venv
BIN := $(VENV)/bin
# Two processes, which share only compiled kernels. The tests of a file run in one of them and share its fixtures.
PARALLEL := -n 2 --dist loadfile
RECIPES := recipes/weather_sweep.yaml recipes/paper/two_pedestrians.yaml
# recipes/paper/wall.yaml is the scene that studies extend, and not a dataset.
STUDIES := $(filter-out $(RECIPES) recipes/paper/wall.yaml,$(sort $(wildcard recipes/paper/*.yaml recipes/attacks/*.yaml)))
LOCKED := $(RECIPES) recipes/towns/crossing.yaml recipes/towns/drive.yaml recipes/drone.yaml recipes/tracking.yaml $(STUDIES)
# `make test` verifies two frames of each of these, in about ten seconds; `make verify` verifies all lockfiles.
SAMPLED := $(wildcard $(patsubst %,lockfiles/%.lock,insertion background_ablation painted_car poster))

# PyBullet has wheels only for CPython 3.10 and 3.11 on x86-64 Linux.
FITS := import sys; sys.exit(sys.implementation.name != "cpython" or sys.version_info[:2] not in {(3, 10), (3, 11)})
PYTHON ?= $(firstword $(foreach p,python3.11 python3.10 python3 python,$(shell $(p) -c '$(FITS)' 2>/dev/null && command -v $(p))))

help:  ## list the targets
	@grep -hE '^[a-z0-9-]+:.*?## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 18

demo: install  ## install, then build recipes/weather_sweep.yaml into datasets/
	$(BIN)/recipe build recipes/weather_sweep.yaml

test: install-dev lint  ## install, lint, type-check, run quick and slow tests, verify some frames of six lockfiles
	$(MAKE) --no-print-directory -j 2 types pytest verify-sample

check: lint types  ## lint, formatting and strict types

# Parts of the two targets above. `make test` runs the tests in parallel with the check of types, followed by the
# verification of frames, with one process each.
.PHONY: lint types pytest verify-sample
lint: install-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install-dev
	$(BIN)/mypy

pytest: install-dev
	$(BIN)/python -m pytest -q $(PARALLEL) --durations=15

verify-sample: install-dev
	$(BIN)/recipe verify --workers 1 $(RECIPES)
	$(if $(SAMPLED),$(BIN)/recipe verify --workers 1 --frames 2 $(SAMPLED))

install: $(VENV)/.installed  ## a virtual environment with the `recipe` command

install-dev: $(VENV)/.installed-dev  ## the same with the development tools

$(VENV)/.installed: requirements/run.txt pyproject.toml | python-fits
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/run.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .
	@touch $@

$(VENV)/.installed-dev: requirements/dev.txt $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/dev.txt
	@touch $@

.PHONY: python-fits
python-fits:
	@if [ -z "$(PYTHON)" ] || ! $(PYTHON) -c '$(FITS)'; then \
	  echo "Dataset Recipe needs CPython 3.10 or 3.11: PyBullet has wheels for no other version. Install one, or name it: make PYTHON=/path/to/python3.11" >&2; \
	  exit 2; fi

test-quick: install-dev  ## tests of every package that take less than about 0.1 s of CPU each
	$(BIN)/python -m pytest -q $(PARALLEL) -m "not slow and not cpus and not torch and not ray and not s3 and not reliability and not soak and not trackeval and not readers and not detector and not browser"

test-cpus: install-dev  ## equal bytes on emulated CPUs (slow; needs qemu-user)
	$(BIN)/python -m pytest -q -m cpus --durations=0

test-reliability: install-dev  ## builds that are killed, or run out of disk space, memory or permissions (some minutes)
	$(BIN)/python -m pytest -q -m reliability -rs --durations=5

test-soak: install-dev  ## an hour of simulated traffic without deadlocks, crashes, ignored red lights or implausible driving (20 minutes)
	$(BIN)/python -m pytest -q $(PARALLEL) --dist load -m soak -rs

test-gpu: install-dev  ## equal bytes on a CUDA GPU; skipped, with the reason, without one
	$(BIN)/python -m pytest -q -m gpu -rs

test-s3: install-dev  ## datasets built into a bucket of a local S3 server (installs s3fs and moto)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 's3fs==2026.9.0' 'moto[server]==5.2.5'
	$(BIN)/python -m pytest -q -m s3

test-ray: install-dev  ## equal bytes from a Ray cluster of two nodes, also after losing one (installs Ray)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'ray==2.60.0'
	$(BIN)/python -m pytest -q -m ray

test-torch: install-dev  ## the PyTorch dataset, `SceneView` and the attack with ART (installs PyTorch, ART and tflite)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' 'adversarial-robustness-toolbox==1.20.1' 'tflite==2.18.0'
	$(BIN)/python -m pytest -q -m torch

test-detector: install-dev  ## the attack study's detectors, compared with TensorFlow Lite and TensorFlow.js (installs them and PyTorch; needs npm)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' 'tflite==2.18.0' 'ai-edge-litert==2.3.0'
	npm install --silent --ignore-scripts --prefix $(VENV)/tfjs '@tensorflow/tfjs@4.22.0'
	NODE_PATH=$(VENV)/tfjs/node_modules $(BIN)/python -m pytest -q -m detector

test-trackeval: install-dev  ## TrackEval's scores of exported layouts (installs TrackEval)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps 'trackeval==1.3.0' 'tabulate==0.10.0'
	$(BIN)/python -m pytest -q -m trackeval

test-browser: install-dev  ## the page of datasets in headless Chromium (installs playwright; needs Debian's chromium)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'playwright==1.65.2'
	$(BIN)/python -m pytest -q -m browser -rs

test-readers: install-dev  ## datasets and exports read by mlcroissant and Hugging Face's datasets (installs both)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/readers.txt
	$(BIN)/python -m pytest -q -m readers --ignore tests/runtime/test_fiftyone.py

test-fiftyone: install-dev  ## a dataset in FiftyOne, on a database in memory (installs FiftyOne without its database)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps --upgrade \
	  --target $(VENV)/fiftyone -r requirements/fiftyone.txt
	PYTHONPATH=$(VENV)/fiftyone $(BIN)/python -m pytest -q -m readers tests/runtime/test_fiftyone.py

fuzz: install-dev  ## fuzz every loader of untrusted files, guided by coverage (FUZZ_SECONDS=60 per loader; installs atheris)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'atheris==3.0.0'
	for target in $$($(BIN)/python -m tests.fuzz); do \
	  echo "fuzz $$target"; \
	  timeout $$(( $(or $(FUZZ_SECONDS),60) + 300 )) $(BIN)/python -m tests.fuzz $$target \
	    -max_total_time=$(or $(FUZZ_SECONDS),60) -verbosity=0; \
	done

bench: install-dev  ## frames per second, compared with a plain PyBullet and Pillow script (nine minutes)
	$(BIN)/python -m benchmarks.listing

bench-long: install-dev  ## a build of 10,000 frames with nothing to do, and verification of 60 of them (ten minutes)
	$(BIN)/python -m benchmarks.long

bench-estimates: install-dev  ## the estimates of `recipe plan`, compared with builds of ten recipes (two minutes)
	$(BIN)/python -m benchmarks.estimates

bench-ray: install-dev  ## cost of Ray relative to local processes, for the same frames (ten minutes; installs Ray)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'ray==2.60.0'
	$(BIN)/python -m benchmarks.cluster

gallery: install  ## redraw docs/gallery.jpg: four towns at noon, at dusk, at night, in rain and in fog
	$(BIN)/python docs/gallery.py

tables: install  ## renew the parts of README.md and docs/ that follow from the code
	$(BIN)/python -m docs.tables

presets: install  ## redraw docs/presets.jpg: all of CARLA's presets from three cameras
	$(BIN)/python docs/presets.py

paper: install-dev  ## measure the paper's studies, and renew their tables and pictures in docs/ (installs OpenCV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps 'opencv-python-headless==5.0.0.93'
	$(BIN)/python -m benchmarks.paper
	$(BIN)/python -m benchmarks.insertion

attack-study: install-dev  ## attack two detectors trained on photographs, and write docs/attack-study.md (hours; installs PyTorch and tflite)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' 'tflite==2.18.0'
	$(BIN)/python -m examples.attacks.study --page docs/attack-study.md

attack-goals: install-dev  ## hide people and cars from detectors, mislead a tracker, and write docs/attack-goals.md (two hours on two cores; installs PyTorch and tflite)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' 'tflite==2.18.0'
	$(BIN)/python -m examples.attacks.goals --page docs/attack-goals.md

evidence-pictures: install-dev  ## show crowds in four towns to two detectors, and write datasets/pictures.json (ten minutes; installs PyTorch and tflite)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' 'tflite==2.18.0'
	mkdir -p datasets
	$(BIN)/python -m benchmarks.pictures --out datasets/pictures.json

verify: install  ## render sampled frames again, and compare them with all lockfiles
	$(BIN)/recipe verify $(LOCKED)

lock: install  ## renew the committed lockfiles after an intended change of bytes
	$(BIN)/recipe lock --update $(LOCKED)

golden: install-dev  ## renew the golden digests after an intended change of bytes
	$(BIN)/python -m tests.golden

requirements: install-dev  ## renew the pinned requirements from pyproject.toml
	$(BIN)/python -m pip install --quiet uv
	for kind in run dev; do \
	  $(BIN)/uv pip compile pyproject.toml requirements/build.in $$([ $$kind = dev ] && echo --extra dev) --universal \
	    --python-version 3.10 --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --no-header \
	    --quiet --output-file requirements/$$kind.txt; \
	done
	$(BIN)/uv pip compile requirements/readers.in --constraint requirements/dev.txt --universal --python-version 3.10 \
	  --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --no-header --quiet \
	  --output-file requirements/readers.txt
	$(BIN)/uv pip compile requirements/fiftyone.in --override requirements/fiftyone-override.in \
	  --constraint requirements/run.txt --universal --python-version 3.10 --generate-hashes --no-emit-index-url \
	  --no-emit-find-links --no-annotate --no-header --quiet --output-file requirements/fiftyone.txt

clean:  ## remove the virtual environment and the caches of tools
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis build dist
