"""The paper: Argatov and Sabina's fourth-order asymptotics, equation by equation.

`law` chooses among the curves of `series` (`power_law_series`, `shape_series`) and estimates their `error`;
`blunt` and `blunt_relations` hold sections 5 and 7 to 9, `hemisphere` section 6, `integral_relations` sections
2 to 4.
"""
