"""Parameter paths: one name for every number of a scene.

``layer.E``, ``substrate.nu``, ``indenter.radius``, ``layer.relaxation.times[0]``: the first word is a part of the
scene, the rest leads to a field of it. Fits, scene files, manifests and tables all use these; what is behind each
of them is declared once (`underlay.quantities`).
"""

from underlay.quantities import kind_of, unknown_parameter

__all__ = ["kind_of", "unknown_parameter"]
