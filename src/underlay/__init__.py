"""underlay: the stiffness of a thin layer from an indentation curve, with the substrate in the model."""

from underlay.data.contact_point import find_contact
from underlay.data.curve import Curve
from underlay.data.noise import Noise
from underlay.data.quality import check_quality
from underlay.data.readers import read, read_all
from underlay.data.synthetic import simulate, synthesize
from underlay.errors import (
    CurveError,
    FileAccessError,
    FileFormatError,
    FitError,
    InputError,
    LawError,
    MaterialError,
    MissingExtraError,
    ParameterError,
    RangeError,
    SchedulerError,
    UnderlayError,
    UnderlayWarning,
    UnitError,
)
from underlay.inference.batch.fit_many import fit_many
from underlay.inference.batch.model import Sampling
from underlay.inference.compare import compare
from underlay.inference.from_files import load_problem
from underlay.inference.identifiability import identifiability
from underlay.inference.least_squares import Fit, fit
from underlay.inference.planning import plan
from underlay.inference.priors import HalfNormal, LogNormal, LogUniform, Normal, Prior, Uniform
from underlay.inference.problem import Problem
from underlay.inference.profiles import profile
from underlay.inference.remedy import remedy
from underlay.inference.sampling.model_comparison import compare_models, with_model_error
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.sampling.run import sample
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Cone, FlatPunch, Indenter, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.kernel import SubstrateKernel
from underlay.mechanics.materials import RIGID, Isotropic, Layer, TransverselyIsotropic
from underlay.mechanics.profile import Profile
from underlay.mechanics.published import PublishedCorrection, published_corrections
from underlay.mechanics.solver import Scaling, Solver
from underlay.mechanics.solvers import Asymptotic, Auto, Exact, HalfSpace, Published, contact_law
from underlay.mechanics.stiffness_relation import modulus_from_stiffness
from underlay.report import plots
from underlay.report.render import report
from underlay.scene.accuracy_cost import accuracy_cost
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene
from underlay.scene.scene_file import load_scene

__all__ = [
    "RIGID",
    "Asymptotic",
    "Auto",
    "Cone",
    "Contact",
    "ContactLaw",
    "Curve",
    "CurveError",
    "Exact",
    "FileAccessError",
    "FileFormatError",
    "Fit",
    "FitError",
    "FlatPunch",
    "HalfNormal",
    "HalfSpace",
    "Indenter",
    "InputError",
    "Instrument",
    "Isotropic",
    "LawError",
    "Layer",
    "LogNormal",
    "LogUniform",
    "MaterialError",
    "MissingExtraError",
    "Noise",
    "Normal",
    "Paraboloid",
    "ParameterError",
    "Posterior",
    "PowerLaw",
    "Prior",
    "Problem",
    "Profile",
    "Published",
    "PublishedCorrection",
    "RangeError",
    "Sampling",
    "Scaling",
    "Scene",
    "SchedulerError",
    "Solver",
    "Sphere",
    "SubstrateKernel",
    "TransverselyIsotropic",
    "UnderlayError",
    "UnderlayWarning",
    "Uniform",
    "UnitError",
    "accuracy_cost",
    "check_quality",
    "compare",
    "compare_models",
    "contact_law",
    "find_contact",
    "fit",
    "fit_many",
    "identifiability",
    "load_problem",
    "load_scene",
    "modulus_from_stiffness",
    "plan",
    "plots",
    "profile",
    "published_corrections",
    "read",
    "read_all",
    "remedy",
    "report",
    "sample",
    "simulate",
    "synthesize",
    "with_model_error",
]
