"""Engineering quantities that follow from an estimate, with intervals by the delta method.

A quantity may be known well though no single parameter is: all parameter sets that explain the logs equally
well then agree on it.
"""
