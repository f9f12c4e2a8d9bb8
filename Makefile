# Everything starts here: each target first makes the environment in .venv, if it is not up to date.
# PYTHON=/path/to/python3.12 chooses the interpreter.

BIN := .venv/bin
ENVIRONMENT := .venv/up-to-date
BENCHMARKS := tests/benchmarks/run.py

# One thread per process: several at once share the cores, and BLAS threads on small arrays cost five times.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help environment demo test bench ops lint format constraints clean

help: ## what there is to make
	@sed -n 's/^\([a-z]*\):.*## /\1|/p' $(MAKEFILE_LIST) | while IFS='|' read -r target purpose; do \
	  printf '  make %-12s %s\n' "$$target" "$$purpose"; done

demo: $(ENVIRONMENT) ## simulate a campaign in a building, map it, write the results into demo/
	$(BIN)/mapsense demo --out demo

test: lint ## every check and every test
	$(BIN)/python -m pytest -q

bench: $(ENVIRONMENT) ## measure speed and accuracy
	$(BIN)/python $(BENCHMARKS)

ops: $(ENVIRONMENT) ## deployments end to end, on one machine and more; faults (PostgreSQL must be there)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[scale]' --group services
	$(BIN)/python tests/deployments/end_to_end.py
	$(BIN)/python tests/deployments/end_to_end.py --postgres --workers 2 --dask 2 --s3
	$(BIN)/python tests/deployments/composed.py
	$(BIN)/python tests/faults/run.py --kills 10

lint: $(ENVIRONMENT) ## style, types and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(ENVIRONMENT) ## rewrite the sources in the project's style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

environment: $(ENVIRONMENT) ## system packages, interpreter and pinned Python packages in .venv

$(ENVIRONMENT): setup.sh pyproject.toml constraints.txt
	./setup.sh
	@touch $@

# Keeps the pinned versions that still fit; UPGRADE=--upgrade takes the newest that fit together.
constraints: ## resolve pyproject.toml into constraints.txt (needs uv)
	uv pip compile --quiet --universal --python-version 3.11 --extra scale --group dev \
	  --group services --group setup $(UPGRADE) --no-annotate \
	  --custom-compile-command 'make constraints' pyproject.toml -o constraints.txt

clean: ## remove the environment, the caches and what the demo wrote
	rm -rf .venv demo .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
