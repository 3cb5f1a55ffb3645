# Everything runs in .venv, made on demand: each target works alone on a fresh clone with Python >= 3.11 and make.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: setup check test test-slow demo excavator machines figures article bench docs model wheel slurm clean

setup: .venv/.ready

.venv/.ready: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install -qq --disable-pip-version-check -e '.[dev]'
	touch $@

check: setup  ## formatter, linter, type checker
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright

test: setup  ## the fast tests
	$(BIN)/pytest -n 2 --dist loadfile -m "not slow"

# in the order of their folders: by the number of tests, a file with one long test would come last, alone
test-slow: setup  ## killed processes, clusters, thousands of files
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder -m slow

demo: setup  ## the whole chain on one log of the virtual rig, and the other log to judge it by
	@echo "The logs are a virtual rig's (a simulation), and the geometry of the arm is ours: see README.md."
	rm -rf runs/demo
	$(BIN)/hydroid fit-mech examples/logs/rig_shoulder_1.csv --out runs/demo/mech
	$(BIN)/hydroid fit-hyd examples/logs/rig_shoulder_1.csv --mech runs/demo/mech --out runs/demo/hyd
	$(BIN)/hydroid validate examples/logs/rig_shoulder_2.csv --fit runs/demo/hyd --out runs/demo/validation

excavator: setup  ## a real excavator: fitted to its twelve logs, judged on the other six
	@echo "The logs are real; the geometry of the arm is ours: see examples/excavator/README.md."
	rm -rf runs/excavator
	$(BIN)/hydroid fit-hyd examples/excavator/fit_*.csv --config examples/excavator/fit.yaml --out runs/excavator/fit
	$(BIN)/hydroid validate examples/excavator/check_*.csv --fit runs/excavator/fit --out runs/excavator/validation

machines: setup  ## the gallery's further machines: a boom, and two cranes with telescopes
	$(BIN)/python docs/machines.py

figures: setup  ## after demo and excavator: docs/figures.yaml, and the pages that state these figures
	$(BIN)/python docs/figures.py

article: setup  ## docs/reproduction.md: adds runs that are missing, the most telling first (ARGS="--minutes 60" of seven hours)
	$(BIN)/python benchmarks/article/run.py $(ARGS)

B ?= structure
bench: setup  ## one benchmark: make bench B=coverage ARGS="--parts own_arm"; docs/measured.md lists them
	$(BIN)/python benchmarks/$(B).py $(ARGS)

docs: setup  ## the reference of all settings, and the documentation as pages: build/docs/index.html
	$(BIN)/python docs/settings_reference.py > docs/settings.md
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs

model: setup  ## the shipped arm's meshes and its MJCF model
	$(BIN)/python meshes/make_meshes.py
	$(BIN)/python meshes/make_models.py

wheel: setup  ## the wheel in an empty environment, run from an empty folder
	PYTHON=$(BIN)/python sh .ci/wheel

slurm: setup  ## the cluster scripts on a real Slurm on this machine (Debian, root); says so where there can be none
	.ci/slurm $(BIN)/pytest tests/parallel/test_slurm.py

clean:
	rm -rf .venv runs dist build
