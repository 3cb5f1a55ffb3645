"""What a finished run stores, and from which its report is drawn: `estimate.yaml` and
`result.npz`.

    record = load_record("runs/a")
    record.summary.values, record.result.fitted[0].response

A validation stores each unseen log as VALIDATIONS/NAME/result.npz in the folder of the
run.
"""

import glob
import hashlib
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from hydroid.arrays import Array, record
from hydroid.errors import HydroidError, RunError
from hydroid.estimate import NAME, FitSummary
from hydroid.files import write_atomic
from hydroid.fitting.fit import Fit
from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import Baselines, judge
from hydroid.identified_model import CONFIG, IdentifiedModel, read_identified
from hydroid.joint_verdict import JointVerdict
from hydroid.log import Log
from hydroid.progress import LOGGER
from hydroid.run.archive import pack, unpack
from hydroid.run.folder import RunFolder, difference, samples
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load
from hydroid.settings.log import log_file
from hydroid.words import numbered

RESULT = "result.npz"
"""name of the file of arrays"""
EARLIER = "earlier.npz"
"""name of the file of the logs of earlier fits"""
STEPS = ("search", "refinement", "uncertainty")
"""of a fit, whose times a run stores"""
VALIDATIONS = "validations"
"""name of the folder of unseen logs"""
LONGEST_NAME = 60
"""characters of a log's name in that of its validation; file systems take 255 bytes"""

T = TypeVar("T")


@record
class Effort:
    """What one refinement took: its iterations and simulations, and why it ended."""

    name: str
    iterations: int
    simulations: int
    ending: str


@record
class FitRecord:
    """What a finished fit is, beside its summary: the same in memory and in a run's
    `result.npz`.

    Attributes:
        fitted: what its final estimate makes of its logs.
        history: of the search, shape (G, len(HISTORY)).
        front: non-dominated candidates, (n, P), and their objectives by segment and
            overall, (n, S + 1).
        segments: objectives of each estimate by segment, (S,), by its name.
        refinements: what each took.
        baselines: simple models fitted to the same logs, by joint and name.
        starts: costs at which the starts of least squares ended, by joint (0: all
            joints together).
    """

    fitted: tuple[Prediction, ...]
    history: Array
    front: tuple[Array, Array]
    segments: Mapping[str, Array]
    refinements: tuple[Effort, ...]
    baselines: Baselines
    starts: Mapping[int, tuple[float, ...]] = field(
        default_factory=dict[int, tuple[float, ...]]
    )


@record
class FinishedRun:
    """A finished run: its folder, as a command takes it, the versions and the hashes of
    its logs, and what it has found.

    After a joint refinement every parameter that was refined is free in the settings.
    Those are of the final estimate; `begun` are the settings with all terms that the fit
    could have added. None: they are not known.
    """

    folder: str
    identity: Mapping[str, Any]
    settings: FitSettings
    summary: FitSummary
    result: FitRecord
    validations: Mapping[str, Prediction]
    begun: FitSettings | None = None

    @property
    def model(self) -> IdentifiedModel:
        """The final estimate with the settings."""
        values = self.summary.values
        theta = self.settings.parameter_set().vector(values, self.folder)
        return IdentifiedModel(self.settings, theta, self.folder, self.summary)

    @property
    def seed(self) -> int:
        """Seed of the search."""
        return self.settings.search.seed

    @property
    def seconds(self) -> dict[str, float]:
        """What the fit took [s], by its steps; of a resumed one since it went on. Empty
        of a run that does not say so."""
        taken = self.identity.get("seconds", {})
        return {step: float(taken[step]) for step in STEPS if step in taken}

    @property
    def rms_deg(self) -> float:
        """Error of the final estimate on its logs; infinite where it diverged."""
        return math.inf if self.summary.rms_deg is None else self.summary.rms_deg

    @cached_property
    def verdict(self) -> tuple[JointVerdict, ...]:
        """The verdict on each joint, by the fitted logs and the unseen ones."""
        unseen = [*self.validations.values()]
        return judge(self.settings, self.result.fitted, self.result.baselines, unseen)


def fit_record(
    fit: Fit, fitted: tuple[Prediction, ...], baselines: Baselines
) -> FitRecord:
    """Return the record of a fit, with what it makes of its logs and the baselines of
    these."""
    efforts = list[Effort]()
    for name, refinement in fit.refinements.items():
        ending = refinement.ending.value
        efforts.append(
            Effort(name, refinement.iterations, refinement.evaluations, ending)
        )
    return FitRecord(
        fitted=fitted,
        history=fit.history,
        front=fit.front,
        segments={name: estimate.segments for name, estimate in fit.estimates.items()},
        refinements=tuple(efforts),
        baselines=baselines,
        starts={joint: tuple(costs) for joint, costs in fit.ends.items()},
    )


def write_record(folder: Path, fit: FitRecord) -> None:
    """Write the record of a fit to its run folder."""
    write_atomic(folder / RESULT, pack(fit))


def run_of(model: IdentifiedModel) -> Path | None:
    """Return the folder of the finished run that a model is from."""
    file = Path(model.source)
    is_finished = file.name == NAME and (file.parent / RESULT).is_file()
    return file.parent if is_finished else None


def keep_validation(
    model: IdentifiedModel, predictions: Sequence[Prediction]
) -> Path | None:
    """Store predictions of unseen logs in the run that a model is from; return it.

    Nothing is stored of a model that is from no run, or whose settings are not the
    run's. What was stored of the same file before is replaced.
    """
    folder = run_of(model)
    unseen = [prediction for prediction in predictions if prediction.unseen]
    if folder is None or not unseen:
        return None
    # with other settings, such as by --set, it is another model than the run's
    if read_identified(folder).settings != model.settings:
        return None
    for prediction in unseen:
        name = validation_name(prediction.log)
        write_atomic(folder / VALIDATIONS / name / RESULT, pack(prediction))
    return folder


def validation_name(log: Log) -> str:
    """Return the name of a log's folder among the validations: its file's,
    and a digest of the file's place.

    Of a log that is no file the digest is that of its samples. A part of a file has its
    number in both.
    """
    file = log_file(log.source)
    # a name may be longer than Path allows
    if os.path.exists(file):
        number = Path(log.source).name[len(file.name) :]
        place = Path(os.path.realpath(file) + number)
        key = os.fsencode(place)
    else:
        place = Path(log.source)
        key = samples(log)
    name = re.sub(r"[^\w.-]+", "_", place.name).strip(".")[:LONGEST_NAME]
    return f"{name or 'log'}-{hashlib.sha256(key).hexdigest()[:8]}"


def keep_earlier(folder: Path, logs: Sequence[Log]) -> None:
    """Store the logs of the fits that a run began from, in its folder."""
    if logs:
        write_atomic(folder / EARLIER, pack(logs))


def logs_behind(estimate: Path) -> list[Log]:
    """Return the logs that the estimate of a run has seen: the run's,
    and those of fits that it began from.

    Of a file of values that is no run's there are none.

    Raises RunError: the run's cannot be read.
    """
    folder = estimate.parent
    if estimate.name != NAME or not (folder / RESULT).is_file():
        return []
    logs = [prediction.log for prediction in _read(folder / RESULT, FitRecord).fitted]
    if (folder / EARLIER).is_file():
        logs += _read(folder / EARLIER, tuple[Log, ...])
    return logs


def record_of(model: IdentifiedModel) -> FitRecord | None:
    """Return the record of the fit that a model is from; None if it is from no run."""
    folder = run_of(model)
    return None if folder is None else _read(folder / RESULT, FitRecord)


def load_record(folder: str | Path) -> FinishedRun:
    """Read a finished run. A validation that cannot be read is left out, with a
    warning.

    Logs of one name have different ones there: `log.csv` and `log.csv (2)`.
    """
    path = Path(folder)
    identity = RunFolder(path).identity()
    model = read_identified(path)
    result = _read(path / RESULT, FitRecord)
    unseen = _validations(path)
    fitted = _with_distinct_names([*result.fitted, *unseen.values()])
    count = len(result.fitted)
    return FinishedRun(
        folder=str(folder),
        identity=identity,
        settings=model.settings,
        summary=model.summarise(),
        result=replace(result, fitted=tuple(fitted[:count])),
        validations=dict(zip(unseen, fitted[count:], strict=True)),
        begun=load(path / CONFIG, FitSettings),
    )


def _with_distinct_names(predictions: Sequence[Prediction]) -> list[Prediction]:
    """Return predictions whose logs all have names of their own."""
    sources = numbered(prediction.log.source for prediction in predictions)
    return [
        replace(prediction, log=replace(prediction.log, source=source))
        for prediction, source in zip(predictions, sources, strict=True)
    ]


def _validations(folder: Path) -> dict[str, Prediction]:
    """Read the validations of a run, by their folders' names; a copy of a log counts
    once."""
    unseen = dict[str, Prediction]()
    contents = set[bytes]()
    # in an order that does not depend on the file system
    for file in sorted(folder.glob(f"{VALIDATIONS}/*/{RESULT}")):
        try:
            prediction = _read(file, Prediction, "validate again")
        except RunError as error:
            LOGGER.warning("left out: %s", error)
            continue
        content = samples(prediction.log)
        if content not in contents:
            contents.add(content)
            unseen[file.parent.name] = prediction
    return unseen


def _read(file: Path, kind: type[T], hint: str = "fit again with this version") -> T:
    """Read what `pack` wrote of a dataclass.

    Raises RunError: it is not there, or not of this kind.
    """
    try:
        (tree,) = _adapter(kind).validate_python((unpack(file),))
    except FileNotFoundError:
        raise RunError(
            "holds no result", file.parent, "finish the fit: --resume"
        ) from None
    except (OSError, ValueError, KeyError, EOFError, ValidationError) as error:
        what = f"cannot be read ({type(error).__name__})"
        raise RunError(what, file, hint) from None
    return tree


@cache
def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    # inside a tuple: pydantic takes a configuration for no dataclass by itself
    in_tuple: Any = tuple.__class_getitem__((kind,))
    return TypeAdapter(in_tuple, config=ConfigDict(arbitrary_types_allowed=True))


def read_runs(names: Sequence[str], out: str | Path | None) -> tuple[FinishedRun, ...]:
    """Read finished runs that differ in nothing but their seeds, in their order,
    and leave out the others.

    `names` are run folders, or patterns of them;
    `out` is the folder for what is to be written about them.

    Raises RunError: no finished run is there, or two differ in more than their seeds.
    """
    if out is not None and RunFolder(Path(out)).exists:
        raise RunError("is a run itself", out, "name another folder")
    runs = list[FinishedRun]()
    # one that cannot be read does not keep the others from being merged
    for path in _matching(names):
        try:
            runs.append(_finished_run(path))
        except HydroidError as error:
            LOGGER.warning("left out: %s", error)
    if not runs:
        where = " ".join(names)
        raise RunError(
            "no finished run is there", where, "resume those that were stopped"
        )
    runs.sort(key=lambda run: run.seed)
    for before, run in pairwise(runs):
        other = difference(run.identity, before.identity, but="search.seed")
        if run.seed == before.seed:
            other = f"has seed {run.seed}, as {before.folder} has"
        if other:
            raise RunError(other, run.folder, "leave it out, or merge it apart")
    return tuple(runs)


def _matching(names: Sequence[str]) -> list[str]:
    """Return the paths that names mean, each once: a name that is no path may be a
    pattern."""
    paths = set[str]()
    for name in names:
        found = [] if os.path.exists(name) else glob.glob(name)
        paths.update(found or [name])
    return sorted(paths)


def _finished_run(path: str) -> FinishedRun:
    """Read a finished run that can be merged with others."""
    folder = RunFolder(Path(path))
    status = folder.identity().get("status")
    if status != "done":
        raise RunError(f"is not finished ({status})", path, "resume it")
    folder.refuse_changes()
    record = load_record(path)
    if record.summary.rms_deg is None:
        raise RunError("has no final estimate that could be simulated", path)
    return record
