"""Jobs that `--dask slurm` asks for; whatever else a site wants stands in Dask's own `jobqueue.yaml`."""

from typing import Annotated

from pydantic import Field

from hydroid.settings.load import Settings


class ClusterSettings(Settings):
    """Slurm jobs that hold Dask workers, one worker a core."""

    jobs: Annotated[int, Field(ge=1, le=10_000)] = 1
    cores: Annotated[int, Field(ge=1, le=1024)] = 4
    """of one job"""
    memory: Annotated[str, Field(pattern=r"^[0-9]+ ?[KMGT]i?B$")] = "4GiB"
    """of one job"""
    walltime: Annotated[str, Field(pattern=r"^([0-9]+-)?[0-9]{1,2}:[0-9]{2}:[0-9]{2}$")] = "01:00:00"
    """of one job, [days-]hours:minutes:seconds; another one takes its place when it ends"""
    queue: str | None = None
    """Slurm's partition; left out: the site's default"""
