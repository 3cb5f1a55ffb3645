"""Every command as one function, in the groups of `hydroid --help`: look, fit, judge, plan, model.

`import hydroid` gives them. They import what simulates or draws when they need it, so that a wrong input is
answered at once.
"""
