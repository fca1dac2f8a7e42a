"""Messages of the library in the words of scene files and commands, for people who do not program.

The library speaks to whoever calls it from Python. What a command prints and the browser page shows goes
through `spoken`, which says TOML keys and flags for Python's arguments and is the one place where the two
languages meet; tests/test_wording.py reads every message of the library and holds that no Python argument is
left.

`markdown_text` does the same service to words of unknown origin inside Markdown, and `gathered_warnings`
keeps our own warnings until the result that they belong to is shown.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from underlay._text import one_line
from underlay.errors import UnderlayWarning

__all__ = ["gathered_warnings", "markdown_text", "spoken"]

_PYTHON_TO_COMMAND_LINE: tuple[tuple[str, str], ...] = (
    # what is said where a scene file says it
    (r"\bpass free=\{.*?\}, or a scene file with \[fit\]", "add a [fit] section to the scene file"),
    (r"\(free=\{'noise\.force': None, \.\.\.\}\)", "(noise.force = {} in [fit])"),
    (r"\bsolver=(['\"])(\w+)\1", r'name = "\2" in [solver]'),
    (r"\bform=(['\"])(\w+)\1", r'form = "\2" in [solver]'),
    (r"\bNoise\(force=\.\.\.\) in newtons", 'force = "1 uN" in [noise], with the number of your instrument'),
    (r"\bread\(path, test=\d+\); read_all takes all of them", "--test where the command has it"),
    (
        r"\bgive calibration=\{\.*'spring_constant'.*?\}",
        'give calibration = { spring_constant = "0.04 N/m", sensitivity = "60 nm/V" } in [curve]',
    ),
    (r"\bcolumns=\{[^{}]*\}", 'columns = { depth = "name (unit)", force = "name (unit)" } in [curve]'),
    (r"\bformat='(\w+)'", r'format = "\1"'),
    (
        r"\bthe substrate is RIGID; declare a material as substrate",
        "the substrate is rigid; give [substrate] E and nu",
    ),
    (r"\bRIGID\b", "rigid = true"),
    (r"\bIsotropic\b( or |, )\bTransverselyIsotropic\b", r"isotropic\1transversely isotropic"),
    # what a flag says
    (r"\bpass resume=True to continue it", "continue it with --resume"),
    (r"\bresume=True needs backend", "--resume needs --output"),
    (
        r"\bbuild it with a larger max_depth( or a smaller thickness)?|ask for it again with a larger max_depth",
        "ask for less depth",
    ),
    (r"\bcompile it with a larger max_depth or a smaller thickness", "ask for less depth"),
    (r"\bpass start='given' to begin at the scene's values", "put the scene's values closer to the data"),
    # what a command does
    (r"\b(?:see|use) identifiability\(problem\)", "see underlay identify"),
    (r"\bsee plan\(\)", "see underlay plan"),
    (
        r"\b(?:ul\.)?profile\((?:fit, name|\.\.\.), calibrate=[^()]*\) (does|gives honest ones)",
        r"underlay sample \1",
    ),
    (r"\buse profile\(\.\.\., calibrate=[^()]*\)( or more)?", "use underlay sample"),
    (r"\bprofile\(fit, name\) without calibration walks", "underlay sample follows"),
    (r"\bfit curve\.loading\(\) instead", 'fit segment = "loading" of [curve] instead'),
    (r", for example with curve\.select\(mask\)", ""),
    (r"\bdepth\(force\) needs forces", "a depth is asked for forces"),
    # units as numbers go where a string with its unit is asked
    (
        r"\bgive finite bounds or a prior such as LogUniform\(low, high\) or Normal\(mean, sd\)",
        'give it bounds in [fit], { min = ..., max = ... }, or a prior = "normal" with mean and sd',
    ),
)
_RULES = tuple((re.compile(pattern), words) for pattern, words in _PYTHON_TO_COMMAND_LINE)
# Marks of Markdown, of HTML and of addresses that become links by themselves. One underscore between letters,
# as file names have it, marks nothing. A dollar or a backslash would still begin mathematics in a notebook
# if it were written as an entity: only code is left alone there.
_MARKS = re.compile(r"[`*\[\]<>&~!|#@]|(?<![^\W_])_|_(?![^\W_])|(?<=:)/|(?<=www)\.", re.IGNORECASE)
_MATHEMATICS = re.compile(r"[$\\]+")


def spoken(message: str) -> str:
    """Return a message of the library as the command line and the browser page say it.

    Examples
    --------
    >>> spoken("the series ends there; use solver='exact'")
    'the series ends there; use name = "exact" in [solver]'
    """
    for pattern, words in _RULES:
        message = pattern.sub(words, message)
    return message


def markdown_text(text: object, longest: int | None = None) -> str:
    """Return `text` as one line of Markdown that shows it as it is: no markup, no link, no formula.

    Parameters
    ----------
    text : object
        Words from a file or a name.
    longest : int, optional
        As in `one_line`.
    """
    plain = _MARKS.sub(lambda mark: f"&#{ord(mark[0])};", one_line(text, longest))
    return _MATHEMATICS.sub(lambda mark: f"`{mark[0]}`", plain)


@contextmanager
def gathered_warnings() -> Iterator[list[str]]:
    """Collect our own warnings while something is worked out, to show them after its result."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UnderlayWarning)
        yield texts
    for entry in caught:
        if issubclass(entry.category, UnderlayWarning):
            texts.append(str(entry.message))
        else:
            warnings.warn_explicit(entry.message, entry.category, entry.filename, entry.lineno)
