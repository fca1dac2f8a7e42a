# The public names and where each lives: `__init__.py` reads this file and loads a module when it is asked for.
from .data.contact_point import find_contact as find_contact
from .data.curve import Curve as Curve
from .data.synthetic import Disturbances as Disturbances
from .data.fit_range import in_range as in_range
from .data.quality import check_quality as check_quality
from .data.readers import (
    Format as Format,
    read as read,
    read_all as read_all,
)
from .data.synthetic import (
    simulate as simulate,
    synthesize as synthesize,
)
from .errors import (
    CurveError as CurveError,
    FileAccessError as FileAccessError,
    FileFormatError as FileFormatError,
    FitError as FitError,
    InputError as InputError,
    LawError as LawError,
    MaterialError as MaterialError,
    MissingExtraError as MissingExtraError,
    ParameterError as ParameterError,
    RangeError as RangeError,
    SchedulerError as SchedulerError,
    UnderlayError as UnderlayError,
    UnderlayWarning as UnderlayWarning,
    UnitError as UnitError,
)
from .inference.answer_cost import answer_cost as answer_cost
from .inference.answer_cost import effects_on_answers as effects_on_answers
from .inference.batch.decisions import (
    Decision as Decision,
    Decisions as Decisions,
    read_decisions as read_decisions,
)
from .inference.batch.fit_many import fit_many as fit_many
from .inference.batch.model import MapOptions as MapOptions
from .inference.batch.model import Sampling as Sampling
from .inference.benchmark import benchmark as benchmark
from .inference.compare import compare_bonds as compare_bonds
from .inference.compare import compare as compare
from .inference.films import (
    StiffnessFit as StiffnessFit,
    fit_stiffness as fit_stiffness,
)
from .inference.from_files import load_problem as load_problem
from .inference.design.identifiability import identifiability as identifiability
from .inference.least_squares import (
    Fit as Fit,
    fit as fit,
)
from .inference.design.planning import plan as plan
from .inference.answer_cost import posterior_cost as posterior_cost
from .inference.least_squares.fitting import pointwise_modulus as pointwise_modulus
from .inference.uncertainty.answer import (
    ModulusCurve as ModulusCurve,
    PointwiseModulus as PointwiseModulus,
)
from .inference.uncertainty.known_errors import free_model_error as free_model_error
from .inference.population.result import Population as Population
from .inference.population.population import population as population
from .inference.priors import (
    HalfNormal as HalfNormal,
    LogNormal as LogNormal,
    LogUniform as LogUniform,
    Normal as Normal,
    Uniform as Uniform,
)
from .inference.priors import Prior as Prior
from .inference.problem import Problem as Problem
from .inference.profiling.profile import profile as profile
from .inference.design.second_test import remedy as remedy, second_test as second_test
from .inference.recipe import steps_to_ours as steps_to_ours
from .inference.sampling.run import posterior_from_chain as posterior_from_chain
from .inference.sampling.run import marginalised as marginalised
from .inference.reported_moduli import (
    RelaxationModuli as RelaxationModuli,
    relaxation_moduli as relaxation_moduli,
)
from .inference.sampling.model_comparison import (
    compare_models as compare_models,
    with_model_error as with_model_error,
)
from .inference.sampling.posterior import Posterior as Posterior
from .inference.sampling.run import sample as sample
from .mechanics.adhesion.maugis import DMT as DMT
from .mechanics.adhesion.jkr import JKR as JKR
from .mechanics.adhesion.maugis import Maugis as Maugis
from .mechanics.stiffness_relation import AreaFunction as AreaFunction
from .mechanics.body import (
    RIGID as RIGID,
    Layer as Layer,
    Material as Material,
)
from .mechanics.body import Spring as Spring
from .mechanics.contact import (
    Adhesion as Adhesion,
    Contact as Contact,
)
from .mechanics.contact_law import ContactLaw as ContactLaw
from .mechanics.indenters import (
    Cone as Cone,
    FlatPunch as FlatPunch,
    Indenter as Indenter,
    Paraboloid as Paraboloid,
    PowerLaw as PowerLaw,
    Sphere as Sphere,
)
from .mechanics.kernel import (
    Kernel as Kernel,
    StackKernel as StackKernel,
    SubstrateKernel as SubstrateKernel,
)
from .mechanics.biphasic.material import (
    Biphasic as Biphasic,
    BiphasicTransverse as BiphasicTransverse,
)
from .mechanics.materials import (
    Isotropic as Isotropic,
    TransverselyIsotropic as TransverselyIsotropic,
)
from .mechanics.profile import Profile as Profile
from .mechanics.published.correction import PublishedCorrection as PublishedCorrection
from .mechanics.published.law import published_corrections as published_corrections
from .mechanics.relaxation import (
    PowerLawRelaxation as PowerLawRelaxation,
    Prony as Prony,
    Relaxation as Relaxation,
)
from .mechanics.response import (
    History as History,
    Response as Response,
)
from .mechanics.solver import (
    Scaling as Scaling,
    Solver as Solver,
)
from .mechanics.solvers import (
    Asymptotic as Asymptotic,
    Auto as Auto,
    Exact as Exact,
    HalfSpace as HalfSpace,
    Published as Published,
    Stuck as Stuck,
    contact_law as contact_law,
)
from .mechanics.body import Stack as Stack
from .mechanics.stiffening.law import Gent as Gent
from .mechanics.stiffness_relation import modulus_from_stiffness as modulus_from_stiffness
from .quantities import quantity as quantity
from .report import plots as plots
from .report.excel import write_excel as write_excel
from .report.render import report as report
from .report.tables import with_units as with_units
from .report.review import write_review as write_review
from .scene.discrepancy import Discrepancy as Discrepancy
from .scene.accuracy_cost import accuracy_cost as accuracy_cost
from .scene.effects import Effect as Effect
from .scene.fit_range import FitRange as FitRange
from .scene.instrument import Instrument as Instrument
from .scene.instrument import Lever as Lever
from .scene.noise import LowRankNoise as LowRankNoise
from .scene.noise import Noise as Noise
from .scene.noise import NoiseModel as NoiseModel
from .scene.program import Program as Program
from .scene.scene import Scene as Scene
from .scene.scene_file import load_scene as load_scene

__version__: str
