# Everything runs in .venv, made on demand: each target works alone on a fresh clone with Python >= 3.11 and make.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: setup check test test-slow demo excavator excavator-seeds six-joints bench structure article article-quick accuracy least-squares search-budget many-parameters virtual-boom design-study coverage quantity-coverage own-arm-coverage fuzz kill-resume slurm wheel docs meshes model clean

setup: .venv/.ready

.venv/.ready: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@

check: setup  ## formatter, linter, type checker
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright

test: setup  ## the fast tests: four minutes on two cores
	$(BIN)/pytest -n 2 --dist loadfile -m "not slow"

test-slow: setup  ## killed processes, clusters, thousands of files
	$(BIN)/pytest -n 2 --dist loadfile -m slow

demo: setup  ## both stages on one log of the virtual rig, and the other log to judge them by
	@echo "The logs are a virtual rig's (a simulation), and the geometry of the arm is ours: see README.md."
	rm -rf runs/demo
	$(BIN)/hydroid fit-mech examples/logs/rig_shoulder_1.csv --algorithm ga --out runs/demo/ga
	$(BIN)/hydroid fit-mech examples/logs/rig_shoulder_1.csv --algorithm nsga2 --out runs/demo/nsga2
	$(BIN)/hydroid fit-hyd examples/logs/rig_shoulder_1.csv --mech runs/demo/nsga2 --out runs/demo/hyd
	$(BIN)/hydroid validate examples/logs/rig_shoulder_1.csv examples/logs/rig_shoulder_2.csv \
		--fit runs/demo/ga --fit runs/demo/nsga2 --fit runs/demo/hyd --out runs/demo/validation

excavator: setup  ## a real excavator: fitted to its twelve logs, judged on the other six
	@echo "The logs are real; the geometry of the arm is ours: see examples/excavator/README.md."
	rm -rf runs/excavator
	$(BIN)/hydroid fit-hyd examples/excavator/fit_*.csv --config examples/excavator/fit.yaml --out runs/excavator/fit
	$(BIN)/hydroid validate examples/excavator/check_*.csv --fit runs/excavator/fit --out runs/excavator/validation

excavator-seeds: setup  ## the same from five starts, with time and simulations (docs/measured.md)
	$(BIN)/python benchmarks/excavator.py 5

.PHONY: excavator-folds
excavator-folds: setup  ## models of the excavator compared by logs that their fits left out (docs/measured.md); 40 minutes, goes on where it was
	$(BIN)/python benchmarks/excavator_folds.py

six-joints: setup  ## six hydraulic joints at once, 54 parameters (docs/measured.md)
	$(BIN)/python benchmarks/six_joints.py

bench: setup  ## the time to an answer, what a simulation costs, and what hydroid adds to it (docs/measured.md)
	$(BIN)/python benchmarks/answer.py
	$(BIN)/python benchmarks/throughput.py
	$(BIN)/python benchmarks/plant.py
	$(BIN)/python benchmarks/scaling.py

structure: setup  ## size and shape of the code
	$(BIN)/python benchmarks/structure.py

article: setup  ## the article's tables and figures over ten seeds (docs/reproduction.md); about two hours, goes on where it was
	$(BIN)/python benchmarks/article/run.py

article-quick: setup  ## the same in its short form: shows that everything runs; at most five minutes
	$(BIN)/python benchmarks/article/run.py --quick

accuracy: setup  ## the hydraulics against a stiff reference solver, and 1,000 random sets on all joints
	$(BIN)/python benchmarks/hydraulic_accuracy.py

least-squares: setup  ## our least squares beside scipy's and mujoco.minimize's; ten minutes
	$(BIN)/python benchmarks/least_squares.py

search-budget: setup  ## generations against the share of seeds that reach the optimum; an hour
	$(BIN)/python benchmarks/search_budget.py

many-parameters: setup  ## 27 parameters from far-off starts, beside mujoco.sysid; half an hour
	$(BIN)/pip install --quiet --disable-pip-version-check 'mujoco[sysid]'
	$(BIN)/python benchmarks/many_parameters.py

virtual-boom: setup  ## duties that a fit has not seen, on a boom simulated by other equations; about ten minutes
	$(BIN)/python benchmarks/virtual_boom.py

design-study: setup  ## a designed experiment against random ones of the same length; about ten minutes
	$(BIN)/python benchmarks/designed_experiment.py

.PHONY: suggest-study
suggest-study: setup  ## terms that are left out of the model, and whether suggest names them; goes on where it was; 10 minutes
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/suggest_study.py

coverage: setup  ## whether the intervals hold the truth as often as they say (docs/uncertainty.md)
	$(BIN)/python benchmarks/interval_coverage.py

own-arm-coverage: setup  ## do the intervals of 27 parameters that trade hold? (docs/uncertainty.md)
	$(BIN)/python benchmarks/own_arm_coverage.py

quantity-coverage: setup  ## the same for quantities such as speeds and dead bands (docs/quantities.md)
	$(BIN)/python benchmarks/quantity_coverage.py

.PHONY: prediction-bands leave-one-out
prediction-bands: setup  ## the share of unseen samples inside the bands, with an exact and a wrong model; two minutes
	$(BIN)/python benchmarks/prediction_bands.py

leave-one-out: setup  ## expected and actual error on each of five logs that a fit left out
	$(BIN)/python benchmarks/leave_one_out.py

fuzz: setup  ## 12,000 damaged files of every kind; a quarter of an hour
	$(BIN)/python benchmarks/fuzz.py

kill-resume: setup  ## 100 runs killed at random moments, resumed, and compared bit for bit; 20 minutes at most
	$(BIN)/python benchmarks/kill_resume.py

slurm: setup  ## the cluster scripts on a real Slurm on this machine (Debian, root); says so where there can be none
	.ci/slurm $(BIN)/pytest tests/parallel/test_slurm.py

wheel: setup  ## the wheel in an empty environment, run from an empty folder
	PYTHON=$(BIN)/python sh .ci/wheel

meshes: setup
	$(BIN)/python meshes/make_meshes.py

model: meshes
	$(BIN)/hydroid build-model

.PHONY: pictures
pictures: setup  ## the documentation's pictures of the demo's fits (after make demo; needs Chromium and OpenGL)
	$(BIN)/python docs/pictures.py runs/demo

docs: setup  ## the reference of all settings, and the documentation as pages: build/docs/index.html
	$(BIN)/python docs/settings_reference.py > docs/settings.md
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs

clean:
	rm -rf .venv runs dist build
