"""The exact contact problem: one flat-punch solution serves every shape, depth, thickness and modulus.

`law` is the door; `batch` solves many sets of materials at once. `punch_solution` solves the integral equation on
the rules of `nodes`; `contact_problem` is a shape over a body and follows its contact radius; `master_curve` is
what a law keeps. Tables, each solved once: `curve_family` for power-law tips on bodies that differ in one ratio,
`tip_curves` for spheres and measured tips, and `stored_curves` from a file; `table_laws` reads laws off them.
"""
