"""What a finished run stores, and from which its report is drawn: `estimate.yaml` and `result.npz`.

    record = load_record("runs/a")
    record.summary.values, record.result.fitted[0].response

A validation stores each unseen log as VALIDATIONS/NAME/result.npz in the folder of the run.
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
from hydroid.identified_model import IdentifiedModel, read_identified
from hydroid.joint_verdict import JointVerdict
from hydroid.log import Log
from hydroid.progress import LOGGER
from hydroid.run.archive import pack, unpack
from hydroid.run.folder import RunFolder, difference, samples
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import log_file
from hydroid.words import numbered

RESULT, EARLIER, VALIDATIONS = "result.npz", "earlier.npz", "validations"
"""names of the file of arrays, of that of the logs of earlier fits, and of the folder of unseen logs"""
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
class FitResult:
    """The arrays of a fit: what its estimates make of its logs, and how they came to be.

    The history has shape (G, len(HISTORY)); the front is non-dominated candidates, (n, P), with objectives by
    segment and overall, (n, S + 1); segments are objectives of each estimate by segment, (S,);
    starts are costs at which the starts of least squares ended, by joint (0: all joints together).
    """

    fitted: tuple[Prediction, ...]
    history: Array
    front: tuple[Array, Array]
    segments: Mapping[str, Array]
    refinements: tuple[Effort, ...]
    baselines: Baselines
    starts: Mapping[int, tuple[float, ...]] = field(default_factory=dict[int, tuple[float, ...]])


@record
class Record:
    """A finished run: its folder, as a command takes it, versions and hashes of its logs, what it found.

    After a joint refinement every parameter that was refined is free in the settings.
    """

    folder: str
    identity: Mapping[str, Any]
    settings: FitSettings
    summary: FitSummary
    result: FitResult
    validations: Mapping[str, Prediction]

    @property
    def seed(self) -> int:
        """Of the search."""
        return self.settings.search.seed

    @property
    def rms_deg(self) -> float:
        """Error of the final estimate on its logs; infinite where it diverged."""
        return math.inf if self.summary.rms_deg is None else self.summary.rms_deg

    @cached_property
    def verdict(self) -> tuple[JointVerdict, ...]:
        """By its logs and the unseen ones."""
        return judge(self.settings, self.result.fitted, self.result.baselines, [*self.validations.values()])


def fit_result(fit: Fit, fitted: tuple[Prediction, ...], baselines: Baselines) -> FitResult:
    """Return what a run stores beside its summary."""
    return FitResult(
        fitted,
        fit.history,
        fit.front,
        {name: estimate.segments for name, estimate in fit.estimates.items()},
        tuple(Effort(n, r.iterations, r.evaluations, r.ending.value) for n, r in fit.refinements.items()),
        baselines,
        {joint: tuple(costs) for joint, costs in fit.ends.items()},
    )


def run_of(model: IdentifiedModel) -> Path | None:
    """Return the folder of the finished run that a model is from."""
    file = Path(model.source)
    return file.parent if file.name == NAME and (file.parent / RESULT).is_file() else None


def keep_validation(model: IdentifiedModel, predictions: Sequence[Prediction]) -> Path | None:
    """Store predictions of unseen logs in the run that a model is from; return it.

    Nothing is stored of a model that is from no run, or whose settings are not the run's. What was stored of
    the same file before is replaced.
    """
    folder, unseen = run_of(model), [p for p in predictions if p.unseen]
    if folder is None or not unseen or read_identified(folder).settings != model.settings:
        return None
    for one in unseen:
        write_atomic(folder / VALIDATIONS / validation_name(one.log) / RESULT, pack(one))
    return folder


def validation_name(log: Log) -> str:
    """Return the name of a log's folder among the validations: its file's, and a digest of the file's place.

    Of a log that is no file the digest is that of its samples. A part of a file has its number in both.
    """
    file = log_file(log.source)
    there = os.path.exists(file)  # a name may be longer than Path allows
    number = Path(log.source).name[len(file.name) :]
    place = Path(os.path.realpath(file) + number) if there else Path(log.source)
    key = os.fsencode(place) if there else samples(log)
    name = re.sub(r"[^\w.-]+", "_", place.name).strip(".")[:LONGEST_NAME]
    return f"{name or 'log'}-{hashlib.sha256(key).hexdigest()[:8]}"


def keep_earlier(folder: Path, logs: Sequence[Log]) -> None:
    """Store the logs of the fits that a run began from, in its folder."""
    if logs:
        write_atomic(folder / EARLIER, pack(logs))


def logs_behind(estimate: Path) -> list[Log]:
    """Return the logs that the estimate of a run has seen: the run's, and those of fits that it began from.

    Of a file of values that is no run's there are none. Raises RunError: the run's cannot be read.
    """
    folder = estimate.parent
    if estimate.name != NAME or not (folder / RESULT).is_file():
        return []
    fitted = [one.log for one in _read(folder / RESULT, FitResult).fitted]
    earlier = _read(folder / EARLIER, tuple[Log, ...]) if (folder / EARLIER).is_file() else ()
    return [*fitted, *earlier]


def fitted_by(model: IdentifiedModel) -> tuple[Sequence[Prediction], Baselines]:
    """Return what a model's run made of its logs, and the baselines; nothing if it is from no run."""
    if (folder := run_of(model)) is None:
        return (), {}
    result = _read(folder / RESULT, FitResult)
    return result.fitted, result.baselines


def load_record(folder: str | Path) -> Record:
    """Read a finished run. A validation that cannot be read is left out, with a warning.

    Logs of one name have different ones there: `log.csv` and `log.csv (2)`.
    """
    path = Path(folder)
    identity, model = RunFolder(path).identity(), read_identified(path)
    result = _read(path / RESULT, FitResult)
    unseen = _validations(path)
    every = [*result.fitted, *unseen.values()]
    sources = numbered(one.log.source for one in every)
    named = [
        replace(one, log=replace(one.log, source=source)) for one, source in zip(every, sources, strict=True)
    ]
    count = len(result.fitted)
    validations = dict(zip(unseen, named[count:], strict=True))
    result = replace(result, fitted=tuple(named[:count]))
    return Record(str(folder), identity, model.settings, model.summarise(), result, validations)


def _validations(folder: Path) -> dict[str, Prediction]:
    """Read the validations of a run, by their folders' names; a copy of a log counts once."""
    unseen, known = dict[str, Prediction](), set[bytes]()
    for file in sorted(folder.glob(f"{VALIDATIONS}/*/{RESULT}")):
        try:
            one = _read(file, Prediction, "validate again")
        except RunError as error:
            LOGGER.warning("left out: %s", error)
            continue
        if (content := samples(one.log)) not in known:
            known.add(content)
            unseen[file.parent.name] = one
    return unseen


def _read(file: Path, kind: type[T], hint: str = "fit again with this version") -> T:
    try:
        return _adapter(kind).validate_python((unpack(file),))[0]
    except FileNotFoundError:
        raise RunError("holds no result", file.parent, "finish the fit: --resume") from None
    except (OSError, ValueError, KeyError, EOFError, ValidationError) as error:
        what = f"cannot be read ({type(error).__name__})"
        raise RunError(what, file, hint) from None


@cache
def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    # inside a tuple: pydantic takes a configuration for no dataclass by itself
    one: Any = tuple.__class_getitem__((kind,))
    return TypeAdapter(one, config=ConfigDict(arbitrary_types_allowed=True))


def read_runs(names: Sequence[str], out: str | Path | None) -> tuple[Record, ...]:
    """Read finished runs that differ in nothing but their seeds, in their order, and leave out the others.

    `names` are run folders, or patterns of them; `out` is the folder for what is to be written about them.
    """
    if out is not None and RunFolder(Path(out)).exists:
        raise RunError("is a run itself", out, "name another folder")
    runs: list[Record] = []
    groups = ([name] if os.path.exists(name) else glob.glob(name) or [name] for name in names)
    for path in sorted({path for group in groups for path in group}):
        try:
            folder = RunFolder(Path(path))
            if (status := folder.identity().get("status")) != "done":
                raise RunError(f"is not finished ({status})", path, "resume it")
            folder.refuse_changes()
            record = load_record(path)
            if record.summary.rms_deg is None:
                raise RunError("has no final estimate that could be simulated", path)
            runs.append(record)
        except HydroidError as error:
            LOGGER.warning("left out: %s", error)
    if not runs:
        raise RunError("no finished run is there", " ".join(names), "resume those that were stopped")
    runs.sort(key=lambda run: run.seed)
    for before, run in pairwise(runs):
        other = difference(run.identity, before.identity, but="search.seed")
        if run.seed == before.seed:
            other = f"has seed {run.seed}, as {before.folder} has"
        if other:
            raise RunError(other, run.folder, "leave it out, or merge it apart")
    return tuple(runs)
