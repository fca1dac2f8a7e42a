"""Works as BibTeX entries."""

from __future__ import annotations

import re
from collections.abc import Iterable

from underlay.inference.citation.works import Work

__all__ = ["bibtex"]

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
