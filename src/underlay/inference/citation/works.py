"""The works that an analysis may stand on, each declared once, and as BibTeX.

The works that an analysis may stand on, each declared once; DOIs only where a source confirms them.

Published corrections are not repeated here: their records name their sources (`mechanics/published`).

Works as BibTeX entries.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from underlay._version import VERSION
from underlay.errors import InputError
from underlay.mechanics.published import published_corrections

__all__ = ["Work", "bibtex", "work"]


@dataclass(frozen=True)
class Work:
    """Something to cite.

    Parameters
    ----------
    key : str
        What bibliographies know it by.
    authors : tuple of str
        Family names, with initials where they are known.
    year : int or None
        Of publication; None where no source here says it.
    title : str
        Empty where no source here says it.
    where : str
        Journal, volume and first page; for a program its version.
    doi : str
        Empty where no source confirms it.
    program : bool
        Whether it is software.
    """

    key: str
    authors: tuple[str, ...]
    year: int | None
    title: str
    where: str
    doi: str = ""
    program: bool = False

    def __str__(self) -> str:
        """As a line of a list of references."""
        *first, last = self.authors
        names = f"{', '.join(first)} and {last}" if first else last
        year = f" ({self.year})" if self.year else ""
        doi = f", doi:{self.doi}" if self.doi else ""
        return f"{names}{year}{', ' if self.title else ''}{self.title}, {self.where}{doi}"


_WORKS = (
    Work("underlay", ("the underlay developers",), None, "underlay", f"version {VERSION}", program=True),
    Work(
        "argatov_sabina",
        ("Argatov, I. I.", "Sabina, F. J."),
        None,
        "Asymptotic analysis of the substrate effect for an arbitrary indenter",
        "Quarterly Journal of Mechanics and Applied Mathematics",
    ),
    Work(
        "sneddon1965",
        ("Sneddon, I. N.",),
        1965,
        "The relation between load and penetration in the axisymmetric Boussinesq problem for a punch of arbitrary "
        "profile",
        "International Journal of Engineering Science 3, 47",
        "10.1016/0020-7225(65)90019-4",
    ),
    Work("spence1968", ("Spence, D. A.",), 1968, "", "Proceedings of the Royal Society A 305, 55"),
    Work(
        "malits2011",
        ("Malits, P.",),
        2011,
        "Contact with stick zone between an indenter and a thin incompressible layer",
        "European Journal of Mechanics A/Solids 30, 884",
    ),
    Work(
        "dunkin1965", ("Dunkin, J. W.",), 1965, "", "Bulletin of the Seismological Society of America 55, 335"
    ),
    Work(
        "johnson1971",
        ("Johnson, K. L.", "Kendall, K.", "Roberts, A. D."),
        1971,
        "Surface energy and the contact of elastic solids",
        "Proceedings of the Royal Society A 324, 301",
        "10.1098/rspa.1971.0141",
    ),
    Work(
        "derjaguin1975",
        ("Derjaguin, B. V.", "Muller, V. M.", "Toporov, Y. P."),
        1975,
        "Effect of contact deformations on the adhesion of particles",
        "Journal of Colloid and Interface Science 53, 314",
        "10.1016/0021-9797(75)90018-1",
    ),
    Work(
        "maugis1992",
        ("Maugis, D.",),
        1992,
        "",
        "Journal of Colloid and Interface Science 150, 243",
        "10.1016/0021-9797(92)90285-T",
    ),
    Work("lee1960", ("Lee, E. H.", "Radok, J. R. M."), 1960, "", "Journal of Applied Mechanics"),
    Work("ting1966", ("Ting, T. C. T.",), 1966, "", "Journal of Applied Mechanics"),
    Work(
        "marquardt1963",
        ("Marquardt, D. W.",),
        1963,
        "",
        "Journal of the Society for Industrial and Applied Mathematics 11",
        "10.1137/0111030",
    ),
    Work(
        "golub1973",
        ("Golub, G. H.", "Pereyra, V."),
        1973,
        "",
        "SIAM Journal on Numerical Analysis 10",
        "10.1137/0710036",
    ),
    Work(
        "harville1977",
        ("Harville, D. A.",),
        1977,
        "",
        "Journal of the American Statistical Association 72",
        "10.1080/01621459.1977.10480998",
    ),
    Work(
        "kennedy2001",
        ("Kennedy, M. C.", "O'Hagan, A."),
        2001,
        "",
        "Journal of the Royal Statistical Society B 63",
        "10.1111/1467-9868.00294",
    ),
    Work(
        "rybicki1995",
        ("Rybicki, G. B.", "Press, W. H."),
        1995,
        "",
        "Physical Review Letters 74, 1060",
        "10.1103/PhysRevLett.74.1060",
    ),
    Work(
        "foreman_mackey2013",
        ("Foreman-Mackey, D.", "Hogg, D. W.", "Lang, D.", "Goodman, J."),
        2013,
        "emcee: The MCMC Hammer",
        "Publications of the Astronomical Society of the Pacific 125, 306",
        "10.1086/670067",
    ),
    Work(
        "goodman2010",
        ("Goodman, J.", "Weare, J."),
        2010,
        "",
        "Communications in Applied Mathematics and Computational Science 5, 65",
        "10.2140/camcos.2010.5.65",
    ),
    Work(
        "ter_braak2006",
        ("ter Braak, C. J. F.",),
        2006,
        "",
        "Statistics and Computing 16",
        "10.1007/s11222-006-8769-1",
    ),
    Work(
        "raftery2010",
        ("Raftery, A. E.", "Bao, L."),
        2010,
        "",
        "Biometrics 66",
        "10.1111/j.1541-0420.2010.01399.x",
    ),
    Work(
        "vehtari2021",
        ("Vehtari, A.", "Gelman, A.", "Simpson, D.", "Carpenter, B.", "Bürkner, P.-C."),
        2021,
        "",
        "Bayesian Analysis 16",
        "10.1214/20-BA1221",
    ),
    Work(
        "harris2020",
        ("Harris, C. R.", "others"),
        2020,
        "Array programming with NumPy",
        "Nature 585, 357",
        "10.1038/s41586-020-2649-2",
    ),
    Work(
        "virtanen2020",
        ("Virtanen, P.", "others"),
        2020,
        "SciPy 1.0: fundamental algorithms for scientific computing in Python",
        "Nature Methods 17, 261",
        "10.1038/s41592-019-0686-2",
    ),
    Work("lmfit", ("Newville, M.", "others"), None, "lmfit", "a program", program=True),
    Work("igor2", ("the igor2 developers",), None, "igor2", "a program", program=True),
    Work("afmformats", ("Müller, P.", "others"), None, "afmformats", "a program", program=True),
)


_BY_KEY: Mapping[str, Work] = {entry.key: entry for entry in _WORKS}


def work(key: str) -> Work:
    """Return the work of a key: one of those above, or the source of a published correction.

    Raises
    ------
    InputError
        If there is none.

    Examples
    --------
    >>> str(work("garcia2018"))
    'Garcia and Garcia (2018), Biophysical Journal 114, 2923-2932, doi:10.1016/j.bpj.2018.05.012'
    """
    if key in _BY_KEY:
        return _BY_KEY[key]
    for correction in published_corrections():
        if correction.name == key:
            return _of_source(key, correction.source, correction.doi or "")
    raise InputError(f"nothing to cite is known by the key {key!r:.60}")


#: "Dimitriadis, Horkay & Chadwick 2002, Biophysical Journal 82, 2798-2810".
_SOURCE = re.compile(r"(?P<authors>.+?) (?P<year>\d{4}), (?P<where>.+)")


def _of_source(key: str, source: str, doi: str) -> Work:
    found = _SOURCE.fullmatch(source)
    if found is None:
        raise InputError(f"the source of {key} does not begin with authors and year: {source}")
    authors = tuple(name.strip() for name in re.split(r",|&", found["authors"]) if name.strip())
    return Work(key, authors, int(found["year"]), "", found["where"], doi)


# What TeX takes for a command.
_SPECIAL = re.compile(r"([&%$#_{}])")


#: Journal, volume, pages: "Biophysical Journal 82, 2798-2810".
_JOURNAL = re.compile(r"(?P<journal>\D+?) (?P<volume>\d+)(?:, (?P<pages>[\d-]+))?")


def bibtex(works: Iterable[Work]) -> str:
    """Return one entry a work; what is not known of it is left out.

    Examples
    --------
    >>> from underlay.inference.citation.works import work
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
    return "\n".join(_entry(work) for work in works)


def _entry(work: Work) -> str:
    fields = {
        "author": " and ".join(work.authors),
        "title": f"{{{_plain(work.title)}}}" if work.title else "",
    }
    fields["year"] = str(work.year or "")
    where = _JOURNAL.fullmatch(work.where)
    if work.program:
        fields["note"] = _plain(work.where)
    elif where is None:
        fields["journal"] = _plain(work.where)
    else:
        fields["journal"] = _plain(where["journal"])
        fields["volume"] = where["volume"]
        fields["pages"] = (where["pages"] or "").replace("-", "--")
    fields["doi"] = work.doi
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join([f"@{'software' if work.program else 'article'}{{{work.key},", *lines, "}", ""])


def _plain(text: str) -> str:
    return _SPECIAL.sub(r"\\\1", text)
