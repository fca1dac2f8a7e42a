"""Floor 1: pure contact mechanics. numpy and scipy only; no data, no files, no fitting.

Equation and section numbers without another source are those of "the paper": Argatov and Sabina, asymptotic
analysis of the substrate effect for an arbitrary indenter. Symbols of all modules, unless they say otherwise: w
depth (m), P force (N), a contact radius (m), h thickness of the layer on top (m), eps = a/h, theta = E/(2 (1 -
nu^2)) the elastic constant (Pa), H(r) the depth at which the contact radius on a half-space is r (m), and 1 -
L(u) the kernel of the body, u the wavenumber times h. varpi is the contact radius on a half-space at the same
depth, over h.
"""
