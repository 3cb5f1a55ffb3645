"""How logs are simulated."""

from typing import Annotated, Literal

from pydantic import Field

from hydroid.settings.load import Settings


class SimulationSettings(Settings):
    """How logs are simulated."""

    model: Literal["dynamic", "quasi-static", "ladder"] = "dynamic"
    """of stage 2. dynamic: oil stiffness, inertia and stops; quasi-static: speed follows valve and load at
    once, one step a sample; ladder: a fit searches and refines the quasi-static model, then refines the
    dynamic one from there, and keeps it where it is clearly nearer to the logs"""
    other_joints: Literal["locked", "passive", "measured"] = "locked"
    """how to treat joints that have no command in the log and are not compared. locked: they stand still,
    which is the fastest; passive: they move on their own spring and damper, as in the article; measured:
    they follow their logged motion"""
    steps_per_sample: Annotated[int, Field(ge=1, le=100)] = 1
    """MuJoCo steps per sample of the log"""
    threads: Annotated[int, Field(ge=0, le=1024)] = 0
    """number of threads. 0 means one per core; with --dask it means one per worker"""
    measured_cutoff_hz: Annotated[float, Field(gt=0, le=50)] = 4.0
    """cutoff of the low-pass filter on motion that joints follow [Hz]; its second derivative becomes a
    torque"""

    @property
    def steps(self) -> int:
        """Steps of the model in one sample of the log."""
        return self.steps_per_sample if self.model == "dynamic" else 1
