"""How a record is simulated."""

from typing import Annotated, Literal

from pydantic import Field

from hydroid.settings.load import Settings


class SimulationSettings(Settings):
    """How a record is simulated.

    `other_joints` says what the joints do that are neither driven by the log nor compared with it:
    `locked` leaves them out of the stepped model, exactly; `passive` gives them their own spring and
    damper, as in the article; `measured` prescribes their logged motion.
    """

    other_joints: Literal["locked", "passive", "measured"] = "locked"
    steps_per_sample: Annotated[int, Field(ge=1, le=100)] = 1
    """MuJoCo steps in one sample of the log"""
    threads: Annotated[int, Field(ge=0, le=1024)] = 0
    """0: one a core"""
    chunk_mib: Annotated[int, Field(ge=1, le=512)] = 128
    """memory for one chunk of a population [MiB]"""
    measured_cutoff_hz: Annotated[float, Field(gt=0, le=50)] = 4.0
    """low-pass of a prescribed motion [Hz]: its second derivative is a torque, and sensors are noisy"""
