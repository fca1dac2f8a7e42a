"""A layer that relaxes: the force of any history of depths from the elastic law of the same contact.

Holds *exactly* for a relaxing layer of constant Poisson's ratio on a rigid base (or none), for any tip. With P_el
and w_el(a) the elastic force and the depth at contact radius a, e(t) the relaxation function and the star a
convolution in time, the elastic contact grows by flat punches, dp_el = g_a dw_el(a), with A g_a = 1 inside r <=
a, A the elastic operator of unit modulus, which does not change in time. Write the pressure as int g_a Omega(a,
t) da. Inside the contact the surface must follow the tip, which fixes Omega's share there as in the elastic
contact; everything outside it enters through A g_a = 1 alone, as one number. With x = w_el(a), the depth at
which the elastic contact reaches a, Q(x, t) = int_a^inf Omega obeys at every x separately

    Q = e * dy >= 0,   y = w - x in contact, free to relax where Q = 0,   P(t) = int Q(x, t) P_el''(x) dx :

a bed of independent springs (`bed`). While the contact grows this is the superposition of Lee
and Radok (1960); after a single maximum it is Ting's (1966) construction: both in `history`, on the integrals
of `memory` and the times of `equal_radius`. Nothing of the half-space was used, only that A is fixed and A g_a
= 1 on the disc. `history` chooses among them; `elastic_base` has what holds where the base is elastic and not
much stiffer.

Multiplying the half-space's force by a thickness factor at the current depth is none of these: the factor belongs
inside the differential dP_el.
"""
