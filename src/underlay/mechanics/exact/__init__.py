"""The exact contact problem: one flat-punch solution serves every shape, depth, thickness and modulus.

`law` is the door; `batch` solves many sets of materials at once. `punch_solution` solves the integral equation on
the rules of `nodes`; `contact_problem` is a shape over a body and follows its contact radius, with `radius_series`
where that folds; `master_curve` is what a law keeps. Tables, each solved once: `curve_family` and `family_law` for
power-law tips on bodies that differ in one ratio, `tip_curves` and `tip_law` for spheres and measured tips, and
`stored_curves` from a file.
"""
