"""What a fit notes of the terms that it tries: the last word is that of all joints."""

from hydroid.fitting.tried import Tried

CLEAR = (40.0, 5.0)
LESS = (2.0, 3.0)


def test_what_a_term_gained_is_not_overwritten_by_a_round_that_did_not_refine_it():
    tried = Tried()
    tried.alone(None, "oil", "curve")
    assert tried.gains == {"oil": None, "curve": None}
    tried.alone(CLEAR, "oil")
    tried.alone(None, "oil")
    assert tried.gains == {"oil": CLEAR, "curve": None}
    tried.alone(LESS, "oil")
    assert tried.gains["oil"] == LESS


def test_what_all_joints_together_decide_stays():
    tried = Tried()
    tried.alone(CLEAR, "oil")
    tried.dropped(LESS, "oil")
    tried.alone(CLEAR, "oil")
    assert tried.gains == {"oil": LESS}
