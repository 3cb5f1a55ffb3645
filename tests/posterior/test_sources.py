"""What the logs and the priors each contribute."""

import numpy as np
import pytest

from hydroid.posterior.flags import Flag, ParameterStatus, Source, flag_of
from hydroid.posterior.sources import data_shares


def test_the_share_of_the_data_is_one_minus_posterior_over_prior_variance():
    rng = np.random.default_rng(0)
    slopes = np.column_stack([np.diag([2.0, 1.0, 0.5]), rng.normal(size=3)])
    prior = np.linalg.inv(slopes @ slopes.T)
    data = rng.normal(size=(3, 20))
    posterior = np.linalg.inv(slopes @ slopes.T + data @ data.T)
    expected = 1 - np.diag(posterior) / np.diag(prior)
    assert data_shares(slopes, np.diag(posterior)) == pytest.approx(expected)


def test_a_parameter_that_no_prior_limits_is_known_from_the_data_alone():
    # the first prior is about parameter 0, the second about the sum of the others
    slopes = np.array([[2.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    assert data_shares(slopes, np.array([0.25, 0.1, 0.1])) == pytest.approx([0.0, 1.0, 1.0])
    assert data_shares(np.empty((2, 0)), np.array([0.1, np.inf])) == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize(
    ("sd", "share", "flag", "source"),
    [
        (0.1, 1.0, Flag.IDENTIFIABLE, Source.DATA),
        (0.1, 0.95, Flag.IDENTIFIABLE, Source.DATA),
        (0.2, 0.5, Flag.IDENTIFIABLE, Source.BOTH),
        (0.3, 0.25, Flag.WEAK, Source.BOTH),
        (0.35, 0.02, Flag.UNIDENTIFIABLE, Source.PRIOR),
        (0.01, 0.0, Flag.UNIDENTIFIABLE, Source.PRIOR),
        (np.inf, 1.0, Flag.UNIDENTIFIABLE, None),
    ],
)
def test_the_flag_tells_what_the_logs_alone_determine(sd, share, flag, source):
    assert flag_of(sd, share) is flag
    assert ParameterStatus(flag, share=share).source is source
