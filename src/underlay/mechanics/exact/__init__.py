"""The exact contact problem: one flat-punch solution serves every shape, depth, thickness and modulus.

`law` is the door, `batch` solves many sets of materials at once; `punch_solution` solves the integral equation
on the rules of `nodes` and `gauss`, `contact_problem` is a shape over a body, `contact_curve` and `radius_series`
follow its contact radius, and `master_curve` is what a law keeps.
"""
