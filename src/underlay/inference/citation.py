"""What an analysis used, and the works to cite for it.

The works stand in ``works.bib``, each once, with a DOI only where a source confirms it. Published corrections are
not repeated there: their records name their sources (`mechanics/published`). Every result keeps the keys of what it
used (`used_by`, `of_fit`, `of_sampling`); `underlay cite` reads them back (`cited.py`).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from underlay._version import VERSION
from underlay.errors import InputError
from underlay.mechanics.published.law import published_corrections, published_names
from underlay.scene.scene import Scene

# Works behind the contact laws, by the name of the law in results: key in ``works.bib``, and purpose.
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
# Libraries that read a file, by the format's name.
_READERS = {"asylum": "igor2"}
# Patterns of an entry of ``works.bib``, and of one of its fields, one on a line.
_ENTRY = re.compile(r"@(?P<kind>\w+)\{(?P<key>\w+),\n(?P<fields>(?:  \w+ = \{.*\},\n)+)\}")
_FIELD = re.compile(r"  (\w+) = \{(.*)\},")
# Pattern of a published correction's source: "Dimitriadis, Horkay & Chadwick 2002, Biophysical Journal 82,
# 2798-2810".
_SOURCE = re.compile(
    r"(?P<author>.+?) (?P<year>\d{4}), (?P<journal>\D+?)(?: (?P<volume>\d+)(?:, (?P<pages>[\d-]+))?)?"
)


def used_by(
    laws: Iterable[str], scenes: Collection[Scene] = (), formats: Iterable[str] = ()
) -> dict[str, str]:
    """Return the works behind the laws, samples and files of an analysis, as a mapping from key to purpose.

    Parameters
    ----------
    laws : iterable of str
        Names of contact laws, as in `ContactLaw.method`.
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
    return used | {_READERS[name]: "reading the file" for name in formats if name in _READERS}


def of_fit(*, robust: bool, averaged: bool) -> dict[str, str]:
    """Works behind a least-squares fit, as a mapping from key to purpose.

    `averaged` says that its intervals average over possible noise and drift.
    """
    used = dict.fromkeys(("marquardt1963", "golub1973"), "least squares")
    used["harville1977"] = "size of the noise"
    if robust:
        used["lmfit"] = "a robust loss"
    if averaged:
        used["kennedy2001"] = "a contact model that may be off"
    return used


def of_sampling(*, chain: bool = True, mixture: bool = False) -> dict[str, str]:
    """Works behind a posterior, from key to purpose: of its Markov chain, and of its mixture of draws."""
    used = {}
    if chain:
        used = {
            "foreman_mackey2013": "the sampler",
            "goodman2010": "how it moves",
            "ter_braak2006": "how it moves",
            "vehtari2021": "convergence",
        }
    return used | ({"raftery2010": "draws along the ridges"} if mixture else {})


# --- works ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Work:
    """A citable work: a BibTeX entry.

    Parameters
    ----------
    key : str
        Its key in bibliographies.
    kind : str
        ``"article"`` or ``"software"``.
    fields : mapping of str to str
        author, title, year, journal, volume, pages, note, doi; without those that no source here gives.
    """

    key: str
    kind: str
    fields: Mapping[str, str]

    @property
    def authors(self) -> tuple[str, ...]:
        """Family names, with initials where they are known."""
        return tuple(self.fields["author"].split(" and "))

    @property
    def year(self) -> int | None:
        """Year of publication; None where no source here gives it."""
        return int(self.fields["year"]) if "year" in self.fields else None

    @property
    def doi(self) -> str:
        """Digital object identifier; empty where no source confirms it."""
        return self.fields.get("doi", "")

    def __str__(self) -> str:
        """The work as a line of a list of references."""
        *first, last = self.authors
        names = f"{', '.join(first)} and {last}" if first else last
        known = {name: text.strip("{}").replace("--", "-") for name, text in self.fields.items()}
        where = " ".join(known[name] for name in ("journal", "volume", "note") if name in known)
        doi = f"doi:{self.doi}" if self.doi else ""
        parts = (
            f"{names} ({self.year})" if self.year else names,
            known.get("title"),
            where,
            known.get("pages"),
            doi,
        )
        return ", ".join(part for part in parts if part)

    @property
    def entry(self) -> str:
        """The work as an entry of BibTeX."""
        lines = [f"  {name} = {{{text}}},\n" for name, text in self.fields.items()]
        return f"@{self.kind}{{{self.key},\n{''.join(lines)}}}\n"


def works() -> dict[str, Work]:
    """The works of ``works.bib`` by key."""
    text = Path(__file__).with_name("works.bib").read_text(encoding="utf-8").replace("VERSION", VERSION)
    return {
        found["key"]: Work(found["key"], found["kind"], dict(_FIELD.findall(found["fields"])))
        for found in _ENTRY.finditer(text)
    }


def work(key: str) -> Work:
    """Return the work with a given key: one of ``works.bib``, or the source of a published correction.

    Raises
    ------
    InputError
        If there is none.

    Examples
    --------
    >>> str(work("garcia2018"))
    'Garcia and Garcia (2018), Biophysical Journal 114, 2923-2932, doi:10.1016/j.bpj.2018.05.012'
    """
    known = works()
    if key in known:
        return known[key]
    for correction in published_corrections():
        if correction.name == key:
            return _of_source(key, correction.source, correction.doi)
    raise InputError(f"nothing to cite is known by the key {key!r:.60}")


def _of_source(key: str, source: str, doi: str | None) -> Work:
    found = _SOURCE.fullmatch(source)
    if found is None:
        raise InputError(f"the source of {key} does not begin with authors and year: {source}")
    fields = {name: text for name, text in found.groupdict().items() if text}
    fields["author"] = " and ".join(
        name.strip() for name in re.split(r",|&", found["author"]) if name.strip()
    )
    if "pages" in fields:
        fields["pages"] = fields["pages"].replace("-", "--")
    return Work(key, "article", fields | ({"doi": doi} if doi else {}))


def bibtex(cited: Iterable[Work]) -> str:
    """Return BibTeX text with one entry for each work; unknown fields are left out.

    Examples
    --------
    >>> print(bibtex([work("garcia2018")]))
    @article{garcia2018,
      author = {Garcia and Garcia},
      year = {2018},
      journal = {Biophysical Journal},
      volume = {114},
      pages = {2923--2932},
      doi = {10.1016/j.bpj.2018.05.012},
    }
    <BLANKLINE>
    """
    return "\n".join(entry.entry for entry in cited)
