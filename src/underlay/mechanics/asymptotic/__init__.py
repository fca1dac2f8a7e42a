"""Argatov and Sabina's fourth-order asymptotics of the substrate effect ("the paper"), equation by equation.

`law` chooses among the curves of `series` (`PowerLawSeries`, `ShapeSeries`, `PunchSeries`) and estimates their
error; `blunt` holds sections 5 and 7 to 9, `integral_relations` sections 2 to 4 and 6.
"""
