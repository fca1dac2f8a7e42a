# The pictures and where each is drawn: `__init__.py` reads this file and loads a module when it is asked for.
from .accuracy import (
    accuracy_cost as accuracy_cost,
    answer_cost as answer_cost,
    posterior_cost as posterior_cost,
    what_accuracy_costs as what_accuracy_costs,
)
from .adhesion import adhesion as adhesion
from .corner import corner as corner
from .correlations import correlations as correlations
from .effects import effects as effects
from .film import film as film
from .fit import (
    fit as fit,
    fit_in_time as fit_in_time,
    fit_log as fit_log,
)
from .histogram import histogram as histogram
from .identifiability import identifiability as identifiability
from .laws import laws as laws
from .map import map as map  # noqa: A004  the public name
from .plan import plan as plan
from .pointwise import pointwise_modulus as pointwise_modulus
from .population import population as population
from .predictive import predictive as predictive
from .profile import profile as profile
from .relaxation import relaxation as relaxation
from .scene import scene as scene
from .segments import segments as segments
from .style import save as save
from .survey import (
    survey as survey,
    verdicts as verdicts,
)
