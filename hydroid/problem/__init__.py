"""The estimation problem: parameters, channels, objectives and priors; candidates in,
objectives out."""
