"""underlay: the stiffness of a thin layer from an indentation curve, with the substrate in the model."""

from underlay.errors import UnderlayError, UnderlayWarning
from underlay.mechanics.accuracy import Accuracy, contact_law
from underlay.mechanics.indenters import Cone, FlatPunch, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.kernel import SubstrateKernel
from underlay.mechanics.materials import RIGID, Isotropic, Layer, TransverselyIsotropic
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene

__all__ = [
    "RIGID",
    "Accuracy",
    "Cone",
    "FlatPunch",
    "Instrument",
    "Isotropic",
    "Layer",
    "Paraboloid",
    "PowerLaw",
    "Scene",
    "Sphere",
    "SubstrateKernel",
    "TransverselyIsotropic",
    "UnderlayError",
    "UnderlayWarning",
    "contact_law",
]
