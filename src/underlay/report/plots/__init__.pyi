# The pictures and where each is drawn: `__init__.py` reads this file and loads a module when it is asked for.
from .accuracy import (
    accuracy_cost as accuracy_cost,
    answer_cost as answer_cost,
    posterior_cost as posterior_cost,
    what_accuracy_costs as what_accuracy_costs,
)
from .depths import adhesion as adhesion
from .map import boxes as boxes
from .design import budget as budget
from .posterior import corner as corner
from .design import correlations as correlations
from .scene import effects as effects
from .depths import film as film
from .fit import (
    fit as fit,
    fit_in_time as fit_in_time,
    fit_log as fit_log,
)
from .map import histogram as histogram
from .design import identifiability as identifiability
from .fit import laws as laws
from .map import map as map  # noqa: A004  the public name
from .design import plan as plan
from .depths import pointwise_modulus as pointwise_modulus
from .map import population as population
from .posterior import predictive as predictive
from .posterior import profile as profile
from .fit import drainage as drainage
from .fit import relaxation as relaxation
from .scene import scene as scene
from .fit import segments as segments
from .style import save as save
from .map import (
    survey as survey,
    verdicts as verdicts,
)
