"""One likelihood of a fit, and what is read from it: answers, budget, verdict; `statement` is the way in."""
