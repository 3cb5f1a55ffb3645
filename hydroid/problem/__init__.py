"""The estimation problem: which parameters, where they enter, what is compared, what is known besides."""
