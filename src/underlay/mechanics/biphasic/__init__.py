"""Layers filled with water that drains: linear biphasic (poroelastic) theory.

`Biphasic` and `BiphasicTransverse` are materials; `DrainingPunch` and `DrainingTip` contacts; `Polyline` their
history; `Drainage` the memory of a scene. Inside, from the bottom: `material` (and its numbers without units),
`decaying` and `surface` (the kernel in Laplace and Hankel space); `transfer` (contact equations in Laplace
space); `history` (back to time); `moving` (a moving contact in time); `tables` (isotropic layers, tabulated);
`contacts` (in units); `many` (a fit's draws, off these tables); `judgement` (what is refused or said); `drainage`
(what a scene and a fit ask).

Symbols of all modules: a contact radius, h thickness, w depth, P force; A11, A13, A33, A44 the stiffnesses of
the drained skeleton (A44 the axial shear modulus), theta_d its elastic constant, k_r and k_z the radial and
axial permeability, c = k_z A33 the diffusivity; xi the wavenumber, s the Laplace variable.
"""
