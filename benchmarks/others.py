"""Least squares of other programs on hydroid's problems: how many starts reach the
optimum, simulations, time.

    python benchmarks/others.py [--problems 27 9 10] [--starts 3] [--most 4000] [--minutes 5] [--write]

27  gain, damping and spring of each joint and six masses, from a simulated log of 30 s
    in which all joints move, with noise. mujoco.sysid fits it too, with its own
    rollouts and its own defaults: pip install 'mujoco[sysid]'
9   stage 1 of the rig's shoulder, from its first 30 s
10  stage 2 of the rig's shoulder, from the same

All begin at the same random points between the bounds, which are a factor of 10 on
either side, or those of the settings. Apart from mujoco.sysid all see one function, the
output errors over parameters scaled to the unit box, and take derivatives by
differences. A run ends where its program ends it, or after so many simulations or CPU
minutes. A start has reached the optimum if its rms error is within 1 % of the lowest
that any program found. What is not installed is left out: pip install pypesto.

Every run is a line of build/others/PROBLEM-MOST-MINUTES.jsonl as soon as it has ended. A
run that stands there is not done again, so that an interrupted benchmark goes on. With
--write the rows of all starts so far go to docs/figures.yaml after every start, and
`python docs/figures.py --pages` puts them on their page.
"""

import copy
import io
import json
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml
from common import EXAMPLES, ROOT, Clock, options, row, table, true_log
from made_logs import TRUTH
from mujoco import minimize
from scipy.optimize import least_squares as scipy_least_squares

import hydroid
from hydroid import load_settings
from hydroid.arm.model import load_model
from hydroid.arrays import Array, rms
from hydroid.files import write_atomic
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

JOINTS = range(1, 8)
MASSES = [name for name in TRUTH if name[0] == "M"]
MANY = {f"{name}{j}": TRUTH[name] for name in "KDS" for j in JOINTS}
MANY |= {name: TRUTH[name] for name in MASSES}
"""true values of the problem of 27 parameters"""
QUANTITIES = {"K": "gain", "D": "damping", "S": "stiffness"}
FACTOR = 10.0
"""of the bounds beside the truth, both ways"""
FIGURES = ROOT / "docs" / "figures.yaml"
STORE = ROOT / "build" / "others"
NOISE_DEG = 0.1
SECONDS = 30.0
REACHED = 0.01
FAILED = 1e3
"""residual of a simulation that diverged [rad]"""


class UsedUp(Exception):
    """A program has had all its simulations, or all its time."""


class Allowance:
    """What one run of a program may use.

    Attributes:
        simulations: so far.
        clock: runs since it was made.
    """

    def __init__(self, most: int, minutes: float) -> None:
        self._most = most
        self._minutes = minutes
        self.simulations = 0
        self.clock = Clock()

    def use(self, simulations: int) -> None:
        """Count simulations to come. Raises UsedUp if all have been had."""
        minutes = self.clock.seconds[1] / 60
        if self.simulations >= self._most or minutes >= self._minutes:
            raise UsedUp
        self.simulations += simulations


class Residuals:
    """Output errors of points of the unit box, and the least of them.

    Attributes:
        lowest: rms error [rad] of the best point so far.
    """

    def __init__(self, problem: Problem, allowance: Allowance) -> None:
        self._problem = problem
        self._allowance = allowance
        self.lowest = np.inf

    def __call__(self, points: Array) -> Array:
        """Return the residuals of points, shape (n, p): (n, R)."""
        self._allowance.use(len(points))
        theta = self._problem.parameters.from_unit(np.clip(points, 0.0, 1.0))
        rows = self._problem.output_errors(theta)
        rows = np.where(np.isfinite(rows), rows, FAILED)
        self.lowest = min(self.lowest, float(rms(rows, axis=1).min()))
        return rows

    def of_one(self, point: Array) -> Array:
        """Return the residuals of one point, shape (p,): (R,)."""
        return self(point[None])[0]

    def of_columns(self, points: Array) -> Array:
        """Return the residuals of points in columns, shape (p, n) or (p,): (R, n) or
        (R, 1)."""
        return self(np.atleast_2d(points.T)).T


def by_hydroid(residuals: Residuals, point: Array) -> None:
    """hydroid's own least squares."""
    least_squares(point, residuals, RefinementSettings())


def by_scipy(residuals: Residuals, point: Array) -> None:
    """scipy's trust region reflective."""
    scipy_least_squares(residuals.of_one, point, bounds=(0.0, 1.0))


def by_mujoco(residuals: Residuals, point: Array) -> None:
    """mujoco.minimize."""
    bounds = [np.zeros(point.size), np.ones(point.size)]
    minimize.least_squares(point, residuals.of_columns, bounds, verbose=0)


def by_pypesto(residuals: Residuals, point: Array) -> None:
    """pyPESTO with its default optimiser, from the one start."""
    import pypesto  # pyright: ignore[reportMissingImports]
    import pypesto.optimize  # pyright: ignore[reportMissingImports]

    def cost(x: Array) -> float:
        return float(0.5 * np.sum(residuals.of_one(x) ** 2))

    objective = pypesto.FD(pypesto.Objective(fun=cost), grad=True)
    asked = pypesto.Problem(
        objective, lb=np.zeros(point.size), ub=np.ones(point.size), x_guesses=[point]
    )
    options = pypesto.optimize.OptimizeOptions(allow_failed_starts=False)
    pypesto.optimize.minimize(asked, n_starts=1, options=options, progress_bar=False)


PYPESTO = "pyPESTO, its default"
SYSID = "mujoco.sysid"
PROGRAMS: dict[str, Callable[[Residuals, Array], None]] = {
    "hydroid, least squares alone": by_hydroid,
    "scipy, `trf`": by_scipy,
    "mujoco.minimize": by_mujoco,
    PYPESTO: by_pypesto,
}


def many() -> Problem:
    """Return the problem of 27 parameters."""
    parameters = dict[str, Any]()
    for name, value in MANY.items():
        where: dict[str, Any] = {"quantity": "mass", "link": f"link{name[1:]}"}
        if name not in MASSES:
            where = {"quantity": QUANTITIES[name[0]], "joints": [int(name[1:])]}
        parameters[name] = where | {"bounds": [value / FACTOR, value * FACTOR]}
    stated = {"of": MASSES, "value": sum(MANY[m] for m in MASSES), "sd": 0.5}
    settings = load_settings(
        "article-mech",
        {
            "outputs": list(JOINTS),
            "parameters": parameters,
            "priors": {"total mass": stated},
            "objective.segments": 1,
        },
    )
    log = true_log(settings, MANY, SECONDS, seed=0)
    noise = np.random.default_rng(1).normal(0.0, np.radians(NOISE_DEG), log.angle.shape)
    noise[0] = 0.0
    log.angle[:] += noise
    return Problem(settings, [log])


def rig(config: str) -> Problem:
    """Return a stage of the rig's shoulder."""
    settings = load_settings(config)
    (log,) = hydroid.read_logs([EXAMPLES / "logs" / "rig_shoulder_1.csv"], settings)
    return Problem(settings, [log.first(SECONDS)])


PROBLEMS: dict[int, Callable[[], Problem]] = {
    27: many,
    9: lambda: rig("article-mech"),
    10: lambda: rig("article-hyd"),
}


class Sysid:
    """The arm of stage 1 as a user of mujoco.sysid would set it up.

    Every candidate is a copy of one compiled model without shapes: compiling it anew,
    as its examples do, would cost more time.
    """

    def __init__(self, problem: Problem, allowance: Allowance) -> None:
        from mujoco import sysid

        (log,) = problem.logs
        arm = problem.settings.arm
        self._problem = problem
        self._allowance = allowance
        self._lowest = np.inf
        self._best: Array | None = None
        self._pose = log.angle[0]
        spec = load_model(arm)
        for geom in list(spec.geoms):
            spec.delete(geom)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        spec.option.timestep = log.period
        self._model = spec.compile()
        self._model.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
        self._model.qpos_spring[:] = self._pose
        # the state, not a sensor: MuJoCo evaluates a sensor at the beginning of a step
        angles = [
            (f"{name}_qpos", sysid.SignalType.MjStateQPos) for name in arm.joint_names
        ]
        sequence = sysid.ModelSequences(
            arm.name,
            spec,
            "log",
            sysid.create_initial_state(self._model, self._pose),
            sysid.TimeSeries(log.time, log.command),
            sysid.TimeSeries.from_names(log.time, log.angle, self._model, angles),
            allow_missing_sensors=True,
        )
        self._residual = sysid.build_residual_fn(
            models_sequences=[sequence], build_model=self._build
        )
        # sysid divides the error of a joint by the norm of its angle; the prior gets
        # the middle weight
        norms = np.linalg.norm(log.angle, axis=0) / np.sqrt(2)
        self._weight = np.radians(NOISE_DEG) / np.exp(np.mean(np.log(norms)))

    def fit(self, start: Array) -> float:
        """Return the rms error [rad] of what `mujoco.sysid.optimize` finds from a
        point of the unit box, shape (p,): of its best candidate where it is ended."""
        from mujoco import sysid

        known = self._problem.parameters
        (theta,) = known.from_unit(start[None])
        parameters = sysid.ParameterDict()
        ends = zip(known.names, theta, known.lower, known.upper, strict=True)
        for name, value, low, high in ends:
            parameters.add(sysid.Parameter(name, value, low, high))
        try:
            result, _ = sysid.optimize(parameters, self._residuals, verbose=False)
            best = result.as_vector()
        except UsedUp:
            best = theta if self._best is None else self._best
        return float(rms(self._problem.output_errors(best[None])))

    def _residuals(self, x: Array, parameters: Any) -> Any:
        """Return sysid's residuals and those of the prior; x has shape (P,) or (P,
        n)."""
        columns = np.atleast_2d(x.T).T
        self._allowance.use(columns.shape[1])
        rows, predicted, measured = self._residual(x, parameters)
        scores = self._weight * self._problem.priors.scores(columns.T).T
        self._keep_best(columns, [*rows, scores])
        return (
            [*rows, scores[:, 0] if x.ndim == 1 else scores],
            predicted,
            measured,
        )

    def _keep_best(self, columns: Array, rows: list[Array]) -> None:
        """Remember the candidate with the lowest sum of squares; rows end with one
        column per candidate, or are those of the only one."""
        count = columns.shape[1]
        sums = np.zeros(count)
        for one in rows:
            sums += np.sum(one.reshape(-1, count) ** 2, axis=0)
        place = int(np.argmin(sums))
        if sums[place] < self._lowest:
            self._lowest = float(sums[place])
            self._best = columns[:, place].copy()

    def _build(self, parameters: Any, _: mujoco.MjSpec) -> mujoco.MjModel:
        model = copy.copy(self._model)
        names = self._problem.parameters.names
        for name, value in zip(names, parameters.as_vector(), strict=True):
            place = int(name[1:]) - 1
            match name[0]:
                case "K":
                    model.actuator_gainprm[place, 0] = value
                case "D":
                    model.dof_damping[place] = value
                case "S":
                    model.jnt_stiffness[place] = value
                case _:
                    body = model.body(f"link{name[1:]}").id
                    model.body_inertia[body] *= value / model.body_mass[body]
                    model.body_mass[body] = value
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        data.qpos[:] = self._pose
        mujoco.mj_forward(model, data)
        # the oil that holds the arm at the start
        model.actuator_biasprm[:, 0] = data.qfrc_bias
        return model


@dataclass(frozen=True)
class Run:
    """What became of one start.

    Attributes:
        program: its name.
        start: its number, from 0.
        error: rms [rad] of the best candidate.
        simulations: that the program took.
        seconds: CPU time.
    """

    program: str
    start: int
    error: float
    simulations: int
    seconds: float


def run(
    name: str, problem: Problem, start: int, point: Array, allowance: Allowance
) -> Run:
    """Let a program run from a point of the unit box, shape (p,)."""
    with redirect_stdout(io.StringIO()):
        if name == SYSID:
            error = Sysid(problem, allowance).fit(point)
        else:
            residuals = Residuals(problem, allowance)
            with suppress(UsedUp):
                PROGRAMS[name](residuals, point)
            error = residuals.lowest
    return Run(name, start, error, allowance.simulations, allowance.clock.seconds[1])


def programs(count: int) -> list[str]:
    """Return the programs that are installed and can solve a problem."""
    names = [name for name in PROGRAMS if name != PYPESTO or find_spec("pypesto")]
    if count == len(MANY) and find_spec("absl"):
        names.append(SYSID)
    return names


def stored(file: Path) -> list[Run]:
    """Return the runs that a file has, one a line."""
    if not file.exists():
        return []
    lines = file.read_text(encoding="utf-8").splitlines()
    return [Run(**json.loads(line)) for line in lines]


def main() -> None:
    given = options(
        __doc__, problems=[*PROBLEMS], starts=3, most=4000, minutes=5.0, write=False
    )
    table("parameters | program | reached the optimum | simulations | CPU time, median")
    for count in given.problems:
        problem = PROBLEMS[count]()
        rng = np.random.default_rng(count)
        points = rng.random((given.starts, int(problem.parameters.free.sum())))
        file = STORE / f"{count}-{given.most}-{given.minutes:g}.jsonl"
        file.parent.mkdir(parents=True, exist_ok=True)
        runs = [one for one in stored(file) if one.start < given.starts]
        done = {(one.program, one.start) for one in runs}
        for start, point in enumerate(points):
            for name in programs(count):
                if (name, start) in done:
                    continue
                allowance = Allowance(given.most, given.minutes)
                runs.append(run(name, problem, start, point, allowance))
                with file.open("a", encoding="utf-8") as opened:
                    opened.write(json.dumps(asdict(runs[-1])) + "\n")
            if given.write:
                write(count, shown(runs))
        for name, cells in shown(runs).items():
            row(count, name, *cells)


def shown(runs: list[Run]) -> dict[str, list[str]]:
    """Return what the table says of each program: how many starts reached the optimum,
    simulations, CPU time."""
    best = min(one.error for one in runs)
    rows = dict[str, list[str]]()
    for name in dict.fromkeys(one.program for one in runs):
        of_program = [one for one in runs if one.program == name]
        reached = sum(one.error <= (1 + REACHED) * best for one in of_program)
        simulations = [one.simulations for one in of_program]
        rows[name] = [
            f"{reached} of {len(of_program)}",
            f"{min(simulations):,} to {max(simulations):,}",
            f"{np.median([one.seconds for one in of_program]):.0f} s",
        ]
    return rows


def write(count: int, rows: dict[str, list[str]]) -> None:
    """Write the rows of a problem to the file of figures."""
    text = FIGURES.read_text(encoding="utf-8")
    head = text[: text.index("\n") + 1]
    figures = yaml.safe_load(text)
    figures.setdefault("others", {})[count] = rows
    content = yaml.safe_dump(figures, sort_keys=False, allow_unicode=True, width=110)
    write_atomic(FIGURES, head + content)


if __name__ == "__main__":
    main()
