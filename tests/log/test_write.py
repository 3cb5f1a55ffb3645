from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays
from log_files import RANGES, read

from hydroid.errors import LogError
from hydroid.log import Log, write_log
from hydroid.settings.log import LogSettings

T = 60
names = st.text("abc;, \"'°#[]", max_size=4)
signed = names.map(lambda n: "u" + n + "{joint}")
pairs = names.map(lambda n: ["p" + n + "{joint}", "n" + n + "{joint}"])
scales = st.sampled_from([1, 0.1, 6.25, 10])
logs = st.builds(
    lambda u, q, period: Log("x", np.arange(T, dtype=float) * period, u, q, period),
    arrays(np.float64, (T, 2), elements=st.integers(-1000, 1000).map(lambda n: n / 10)),
    arrays(np.float64, (T, 2), elements=st.floats(-0.5, 1.5)),
    st.sampled_from([0.01, 0.02]),
)
layouts = st.fixed_dictionaries(
    {
        "time": st.fixed_dictionaries(
            {"unit": st.sampled_from(["s", "ms"]), "column": st.just("t")}
        ),
        "command": st.fixed_dictionaries(
            {"column": signed | pairs, "scale": scales, "offset": st.integers(-5, 5)}
        ),
        "angle": st.fixed_dictionaries(
            {
                "column": names.map(lambda n: "q" + n + "{joint}"),
                "unit": st.sampled_from(["deg", "rad"]),
                "scale": scales.flatmap(lambda s: st.sampled_from([s, -s])),
                "offset": st.integers(-5, 5),
            }
        ),
    }
)


@settings(max_examples=80, deadline=None)
@given(logs, layouts, st.integers(-20, 20))
def test_what_is_written_reads_back(
    tmp_path_factory, log: Log, layout: dict, delay: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "written.csv"
    mapping = LogSettings.model_validate(
        {**layout, "period_s": log.period, "delay_s": delay * log.period}
    )
    if delay > 0:
        log.command[:delay] = 0
    elif delay < 0:
        log.command[delay:] = log.command[delay - 1]
    write_log(path, log, mapping)
    back, _ = read(path, mapping, RANGES)
    np.testing.assert_array_equal(back.time, log.time)
    np.testing.assert_allclose(back.command, log.command, atol=1e-7)
    np.testing.assert_allclose(back.angle, log.angle, atol=1e-8)


LOG = Log(
    "x", np.arange(T, dtype=float) * 0.01, np.ones((T, 2)), np.zeros((T, 2)), 0.01
)


def test_nothing_is_lost_silently(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with pytest.raises(LogError, match="joint 2 is driven but no column"):
        write_log(
            path, LOG, LogSettings.model_validate({"joints": {2: {"command": None}}})
        )
    unmeasured = replace(LOG, angle=np.full((T, 2), np.nan))
    with pytest.raises(LogError, match="joint 1 has no angle"):
        write_log(path, unmeasured, LogSettings())
    assert list(tmp_path.iterdir()) == []
    write_log(path, unmeasured, LogSettings(angle=None))
    assert not read(path, LogSettings(angle=None), RANGES)[0].has_angle.any()
