"""Full friction: a tip on whose surface points stick where they touch.

`stuck_punch` is the flat punch with full friction, in functions in which a half-space is the identity (`Basis`),
and the contact that grows by such punches (`Growth`); `law` is the law of an indenter.

References: Mossakovskii 1963; Spence 1968, Proc. R. Soc. A 305, 55; Malits 2011, Eur. J. Mech. A 30, 884;
DLMF, chapter 33.
"""
