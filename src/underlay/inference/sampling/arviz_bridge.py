"""arviz, the one place it is used from: export of a posterior, and the library itself for comparisons."""

from __future__ import annotations

import warnings
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import MissingExtraError

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

__all__ = ["arviz_library", "to_inference_data"]


def arviz_library() -> ModuleType:
    """Import arviz.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        with warnings.catch_warnings():
            # arviz announces its next major version at import, which is not the caller's concern.
            warnings.simplefilter("ignore", FutureWarning)
            import arviz  # noqa: PLC0415  # an optional extra
    except ImportError as error:
        raise MissingExtraError("this needs arviz: install underlay[uq]") from error
    module: ModuleType = arviz
    return module


def to_inference_data(posterior: Posterior, log_likelihood: FloatArray | None = None) -> Any:
    """Posterior as arviz ``InferenceData``; `log_likelihood` is (draws, walkers, points), optional."""
    parameters = {name: posterior.of(name).T for name in posterior.names}
    whole = {name: values.T for name, values in posterior.derived.items()}
    draws = posterior.chain.shape[0]
    parameters |= {name: values for name, values in whole.items() if values.shape[1] == draws}
    groups: dict[str, Any] = {
        "posterior": parameters,
        "sample_stats": {"lp": posterior.log_posterior.T},
        "prior": {name: posterior.prior_quantiles[None, :, i] for i, name in enumerate(posterior.names)},
    }
    if log_likelihood is not None:
        groups["log_likelihood"] = {"force": np.moveaxis(log_likelihood, 0, 1)}
    return arviz_library().from_dict(**groups)
