# Everything runs in .venv, made on demand: `make demo`, `make test`, `make check`, `make bench` each work on a fresh clone.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: setup check test demo bench meshes model clean

setup: .venv/.ready

.venv/.ready: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright

test: setup
	$(BIN)/pytest

clean:
	rm -rf .venv runs dist build
