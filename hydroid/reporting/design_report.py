"""The predicted precision of a designed experiment."""

from collections.abc import Mapping

import numpy as np

from hydroid.advice.design import Design
from hydroid.findings import Finding
from hydroid.parameters import Array
from hydroid.posterior.flags import Flag, flag_of
from hydroid.reporting.table import Cell, Table
from hydroid.settings.experiment import DesignSettings


def design_table(settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Table:
    """Return the predicted precision of each parameter before, after a random and the designed experiment."""

    def row(name: str, deviations: Array) -> dict[str, Cell]:
        before, random, designed = map(float, deviations)
        flag = flag_of(designed)
        return {
            "name": name,
            "estimate": theta[name],
            "before [%]": 100 * before,
            "random [%]": 100 * random,
            "designed [%]": 100 * designed,
            "random / designed": random / designed,
            "flag": "" if flag is Flag.IDENTIFIABLE else flag.value,
        }

    _, direction = design.weakest(design.after)
    shares = direction / direction[np.argmax(np.abs(direction))]
    order = [i for i in np.argsort(-np.abs(shares)) if abs(shares[i]) >= 0.15]
    parts = " ".join(f"{shares[i]:+.2f} {design.names[i]}" for i in order).replace("-", "−")
    time = settings.noise_correlation_s
    noise = f"{settings.noise_deg:g} deg, {f'correlation time {time:g} s' if time else 'white'}"
    safety = Finding("run the experiment", "note").hint
    note = (
        f"Noise: {noise}. before: every parameter ±100 % unless logs say more. random: median of "
        f"{len(design.random)} experiments of the same length and limits. "
        f"The weakest combination: {parts}. {safety}"
    )
    deviations = np.column_stack([design.known.deviations, design.random_deviations, design.after.deviations])
    rows = map(row, design.names, deviations)
    title = "Predicted relative standard deviations"
    return Table.of(title, rows, note, ("random / designed", "estimate"))
