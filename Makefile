# Everything runs in .venv, made on demand: each target works alone on a fresh clone with Python >= 3.11 and make.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: setup check test demo demo-hyd bench article article-hyd wheel meshes model clean

setup: .venv/.ready

.venv/.ready: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@

check: setup  ## formatter, linter, type checker
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright

test: setup
	$(BIN)/pytest

demo: setup  ## both algorithms on one log of the virtual rig, and the other log to judge them by
	@echo "The logs are a virtual rig's (a simulation), and the geometry of the arm is ours: see README.md."
	rm -rf runs/demo
	$(BIN)/hydroid fit-mech examples/logs/rig_shoulder_1.csv --algorithm ga --out runs/demo/ga
	$(BIN)/hydroid fit-mech examples/logs/rig_shoulder_1.csv --algorithm nsga2 --out runs/demo/nsga2
	$(BIN)/hydroid validate examples/logs/rig_shoulder_1.csv examples/logs/rig_shoulder_2.csv \
		--fit runs/demo/ga --fit runs/demo/nsga2 --out runs/demo/validation

demo-hyd: setup  ## stage 2 on the same log, from the demo's stage 1
	@test -f runs/demo/nsga2/estimate.yaml || $(MAKE) demo
	rm -rf runs/demo/hyd
	$(BIN)/hydroid fit-hyd examples/logs/rig_shoulder_1.csv --mech runs/demo/nsga2 --out runs/demo/hyd
	$(BIN)/hydroid validate examples/logs/rig_shoulder_1.csv examples/logs/rig_shoulder_2.csv \
		--fit runs/demo/hyd --out runs/demo/validation-hyd

bench: setup  ## what a simulation costs, and what hydroid adds to it (README, "Speed")
	$(BIN)/python benchmarks/throughput.py

article: setup  ## the article's simulated study over ten seeds (README, "Accuracy"); half an hour
	$(BIN)/python benchmarks/article_mech.py

article-hyd: setup  ## the same for stage 2
	$(BIN)/python benchmarks/article_hyd.py

wheel: setup  ## the wheel in an empty environment, run from an empty folder
	PYTHON=$(BIN)/python sh .ci/wheel

meshes: setup
	$(BIN)/python meshes/make_meshes.py

model: meshes
	$(BIN)/hydroid build-model

clean:
	rm -rf .venv runs dist build
