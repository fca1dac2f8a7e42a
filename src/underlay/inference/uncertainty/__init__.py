"""The likelihood of a fit, and what is computed from it: answers, budget, verdict; begin with `statement`."""
