# Everything from a fresh clone: `make repro` regenerates every table and figure, `make test` runs the tests.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# the commands in dvc.yaml call `python`
export PATH := $(CURDIR)/$(BIN):$(PATH)
# stages and tests start hundreds of processes, each of which would compile every module anew
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help repro test smoke check lint docs bench params
.DEFAULT_GOAL := help

help: ## show this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | sort

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "error: Python 3.11 or newer is needed; try make PYTHON=python3.12" >&2; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -r requirements.lock
	@$(BIN)/python -m compileall -qq -j 0 -x "/tests?/" .venv/lib || true   # pip does it by a single process; tests of packages never run, some files are no Python 3
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $@

repro: $(READY) ## regenerate every table and figure, then say where the report is
	@$(BIN)/python -m pipeline.config
	@$(BIN)/python -m pipeline.dvc repro
	@echo "report: reports/index.html"

test: $(READY) ## run the whole test suite
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder $(PYTEST_ARGS)

smoke: $(READY) ## run everything, tiny, in a scratch copy, and check its metrics against the committed baselines
	@.ci/smoke

check: $(READY) lint ## lint, types, configuration and code dependencies in step
	$(BIN)/mypy
	$(BIN)/python -m pipeline.config --check
	$(BIN)/python -m pipeline.dependencies --check

lint: $(READY) ## style
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

docs: $(READY) ## build the site of docs/ into site/, every link checked
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict && echo "site: site/index.html"

# shared by benchmarks; nothing to run
BENCHMARK_MODULES := camera_shake common flag_rates mean_amae rendered_psf
# their records are of data or programs that only a user can give
BENCHMARKS_OF_DATA := blur_words coded_advice coded_noise flags image_formation noise_budget noisy_blur other_frames processors real_blur unseen_kernels video_codecs
BENCHMARKS := $(filter-out $(BENCHMARK_MODULES) $(BENCHMARKS_OF_DATA),$(basename $(notdir $(wildcard benchmarks/[a-z]*.py))))

bench: $(READY) ## measure speed side by side with peers; results in benchmarks/results
	@for name in $(BENCHMARKS); do $(BIN)/python benchmarks/$$name.py || exit 1; done
	@echo "left out, since they need data of yours: $(BENCHMARKS_OF_DATA)"
	@echo "how to run them: docs/reproduce.md, section Benchmarks of your data"

params: $(READY) ## compile params.yaml from conf/
	@$(BIN)/python -m pipeline.config
