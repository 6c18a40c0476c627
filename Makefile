# The commands that people and CI use; `.ci/run` calls test, then check.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUST   := $(shell find crates sim -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock build_backend.py
# The repo is tested from any folder; nothing here depends on the machine it stands on.
export PIP_DISABLE_PIP_VERSION_CHECK = 1

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-rust test-python check format lock bench bench-plan bench-energy bench-random bench-replan bench-tick bench-sim bench-peers clean

help: ## Show this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):[^#]*## /  \1\t/' | expand -t 18

setup: $(VENV)/.built ## Make .venv with locked dependencies, the extension and both binaries

$(VENV)/.deps: requirements.lock
	$(PYTHON) -c 'import sys; sys.exit("fleet needs Python 3.11 or newer, not %s" % sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --requirement requirements.lock
	@touch $@

$(VENV)/.built: $(VENV)/.deps pyproject.toml $(RUST)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/pip install --quiet --no-build-isolation --no-deps --editable .
	@touch $@

demo: setup ## Plan and fly the power tower with real processes on loopback, and write the report
	$(BIN)/fleet fly scenarios/power_tower.toml

test: test-rust test-python ## Run every test

test-rust:
	cargo test --release --locked --workspace --exclude fleet-py

test-python: setup
	$(BIN)/python -m pytest

check: setup ## Linters, types, stub against module
	cargo fmt --all --check
	cargo clippy --release --locked --workspace --all-targets -- -D warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	MYPYPATH=python $(BIN)/python -m mypy.stubtest fleet._core

format: setup ## Format all code
	cargo fmt --all
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock: setup ## Resolve requirements.lock anew from pyproject.toml
	$(BIN)/pip install --quiet pip-tools
	$(BIN)/pip-compile --quiet --extra dev --strip-extras --upgrade --no-emit-index-url --no-emit-trusted-host --no-emit-find-links -o requirements.lock pyproject.toml

bench: bench-plan bench-random bench-replan bench-tick bench-sim ## Run every benchmark; tables and target/bench/*.json

bench-plan: setup ## Planning time and robustness: ours, the paper's formulation, RRT*; lines of towers (10 minutes)
	$(BIN)/python -m tests.bench.plan

bench-energy: setup ## Energy-aware plans against a long IPOPT run and the paper's method; minutes
	$(BIN)/python -m tests.bench.energy

bench-random: setup ## 200 random scenarios, plans before an independent check, refusals before an oracle
	$(BIN)/python -m tests.bench.random

bench-replan: ## Local replan over random instances
	cargo run --release --locked -p fleet-core --example bench_replan

bench-tick: ## One agent tick
	cargo run --release --locked -p fleet-agent --example bench_tick

bench-sim: setup ## Virtual-time flights against real time
	$(BIN)/python -m tests.bench.sim

target/peers/.built: tests/bench/peers/requirements.txt
	$(PYTHON) -m venv target/peers
	target/peers/bin/pip install --quiet --requirement tests/bench/peers/requirements.txt
	@touch $@

bench-peers: setup target/peers/.built ## fleet against stlpy on the same missions (an environment of its own, half an hour)
	$(BIN)/python -m tests.bench.peers target/peers/bin/python

clean: ## Remove everything that is built
	rm -rf target $(VENV) fleet.data runs python/fleet/_core*.so
