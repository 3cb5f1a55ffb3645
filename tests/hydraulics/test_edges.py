"""Four metering edges and anti-cavitation valves: lowering a load, flow law of each edge."""

import numpy as np
import pytest
from hydraulic_reference import parameters, simulate

from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings(substeps=10)


def lowering(**edges: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Chamber pressures [bar], flows into A and out of B [m³/s], and spool [m] of the shoulder that sinks."""
    seen: list = []
    simulate(parameters(SETTINGS, **edges), np.full(60, -50.0), SETTINGS, observe=seen)
    last = seen[-1][0]
    return 1e-5 * last.pressure[0, 0], last.flow[0, 0], float(last.spool[0, 0])


def test_a_load_sinks_on_the_oil_that_leaves():
    """With a wide A→T edge the pump cannot fill B: the check valve does, and only A carries the load."""
    alike, _, _ = lowering()
    starved, flow, _ = lowering(return_a=6.0, anticavitation=5.0)
    assert alike.min() > 30  # equal edges press both chambers
    assert 0 < starved[1] < 5.0  # below the tank's pressure, and no vapour
    assert starved[0] < alike[0]
    assert flow[0] < 0
    assert flow[1] < 0


def test_without_check_valves_the_same_chamber_cavitates():
    assert lowering(return_a=6.0)[0][1] == 0.0


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_each_edge_has_the_flow_of_its_opening(factor: float):
    pressure, flow, spool = lowering(return_a=factor, leakage=0.0)
    opening = 0.4e-6 * min(abs(spool) / 2e-3, 1.0)
    law = 0.7 * np.sqrt(2 / 860)
    wanted = law * opening * np.array([factor * np.sqrt(pressure[0] - 5), np.sqrt(150 - pressure[1])])
    np.testing.assert_allclose(-flow, wanted * np.sqrt(1e5), rtol=0.02)
