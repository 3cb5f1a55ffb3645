"""Which executor a command's options ask for."""

from contextlib import AbstractContextManager, nullcontext

from hydroid.errors import SettingsError
from hydroid.execution.executor import Executor
from hydroid.settings.simulation import ClusterSettings


def open_executor(
    workers: int | None, dask: str | None, settings: ClusterSettings
) -> AbstractContextManager[Executor | None]:
    """Return what opens the executor and ends its workers; None stands for this process.

    Args:
        workers: processes of this machine.
        dask: the address of a Dask scheduler, or `slurm`.
        settings: of Slurm jobs.

    Raises:
        SettingsError: both are asked for, Dask is not installed, or there is no Slurm here.
        RunError: no scheduler answers.
    """
    if workers is not None and dask is not None:
        raise SettingsError("choose one of --workers and --dask", where="--dask")
    if workers is not None:
        from hydroid.execution.local import LocalPool

        return LocalPool(workers)
    if dask is not None:
        try:
            from hydroid.execution.cluster import DaskCluster
        except ImportError as error:
            hint = "install it: pip install 'hydroid[cluster]'"
            raise SettingsError(f"Dask is not there ({error})", where="--dask", hint=hint) from None
        return DaskCluster(dask, settings)
    return nullcontext()
