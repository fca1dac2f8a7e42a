"""Which works an analysis used, by key, and what for: kept in every result, read back by `underlay cite`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from underlay.mechanics.published import published_names
from underlay.scene.scene import Scene

__all__ = ["of_fit", "of_sampling", "used_by"]

#: Contact laws by the name that results carry.
_PAPER = "argatov_sabina"
_EXACT = {_PAPER: "equations of the contact problem"}
_LAWS: Mapping[str, Mapping[str, str]] = {
    "auto": _EXACT,
    "exact": _EXACT,
    "asymptotic": {_PAPER: "the contact law"},
    "halfspace": {"sneddon1965": "the contact law"},
    "stuck": _EXACT | {"spence1968": "a tip that sticks", "malits2011": "a tip that sticks"},
}
_ADHESION = {"jkr": "johnson1971", "dmt": "derjaguin1975", "maugis": "maugis1992"}
#: Programs that read a file, by the format's name.
_READERS = {"afm": "afmformats", "asylum": "igor2"}


def used_by(
    laws: Iterable[str], scenes: Collection[Scene] = (), formats: Iterable[str] = ()
) -> dict[str, str]:
    """Return what stands behind the laws, samples and files of an analysis: key of the work, and what for.

    Parameters
    ----------
    laws : iterable of str
        Names of contact laws, as `ContactLaw.method` has them.
    scenes : collection of Scene
        The tests.
    formats : iterable of str
        Names of the formats of the files.
    """
    used = {"underlay": "the analysis", "harris2020": "arrays", "virtanen2020": "numerics"}
    for law in dict.fromkeys(laws):
        used |= {law: "the contact law"} if law in published_names() else _LAWS.get(law, {})
    for scene in scenes:
        if len(scene.layers) > 1:
            used["dunkin1965"] = "the kernel of a stack"
        if scene.friction == "stuck":
            used |= _LAWS["stuck"]
        if scene.adhesion is not None:
            key = _ADHESION.get(str(type(scene.adhesion).model))
            used |= {key: "adhesion"} if key else {}
        if scene.memory is not None:
            used |= {"lee1960": "relaxation", "ting1966": "relaxation, on the way back"}
    for name in formats:
        if name in _READERS:
            used[_READERS[name]] = "reading the file"
    return used


def of_fit(*, robust: bool, averaged: bool) -> dict[str, str]:
    """What a least-squares fit adds; `averaged` where its intervals weigh kinds of noise and drift."""
    used = {
        "marquardt1963": "least squares",
        "golub1973": "least squares",
        "harville1977": "size of the noise",
    }
    if robust:
        used["lmfit"] = "a robust loss"
    if averaged:
        used |= {"kennedy2001": "intervals that allow for drift", "rybicki1995": "correlated noise"}
    return used


def of_sampling(*, chain: bool = True, mixture: bool = False) -> dict[str, str]:
    """What a posterior adds: its Markov chain, and the mixture along its ridges where there is one."""
    used = {}
    if chain:
        used = {
            "foreman_mackey2013": "the sampler",
            "goodman2010": "how it moves",
            "ter_braak2006": "how it moves",
            "vehtari2021": "convergence",
        }
    return used | ({"raftery2010": "draws along the ridges"} if mixture else {})
