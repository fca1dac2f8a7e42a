"""What a fit hands back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Fit", "assemble"]

@dataclass(frozen=True)
class Fit:
    problem: Any
    vector: Any
    values: Any
    stderr: Any

def assemble(problem, objective, best, seconds):
    J = objective.jacobian(best.vector)
    cov = np.linalg.pinv(J.T @ J) * best.cost / (J.shape[0] - J.shape[1])
    s = problem.slopes(best.vector)
    return Fit(problem, best.vector, problem.values(best.vector), dict(zip(problem.names, np.sqrt(np.diag(cov)) * s)))
