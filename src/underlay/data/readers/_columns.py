"""Which column of a table is depth, force, time or segment: by name, number, or a sum or product of columns.

The names that are known (`KNOWN`) are those of instruments and spreadsheets in English, German, French,
Spanish and Italian, compared in small letters without accents.

What a column mapping of the caller says is read by a small grammar, of which Python's parser makes the tree; it is
never evaluated as Python::

    sum     = product { ("+" | "-") product }
    product = factor { ("*" | "/") factor }
    factor  = "-" factor | "(" sum ")" | column | number [unit]
    column  = a name of the table, with or without its unit, or "#" and its number from 1

as in ``"ramp - deflection"`` or ``"volts * 41 nm/V * 0.06 N/m"``. Units are carried along as exponents of
metre, newton, second, volt and ampere: what comes out must be a length, a force or a time.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.readers._text import SAID, kind_named, listed, plain, split_label, unit_named, words
from underlay.errors import InputError, UnitError
from underlay.units import unit_factor

#: What a column can be, and the kind of quantity it holds.
ROLES = {"depth": "length", "force": "force", "time": "time", "segment": ""}

#: Names taken for granted, in small letters without accents, best first. English, German, French, Spanish, Italian.
KNOWN = {role: listed(text) for role, text in SAID["columns"].items()}
# What stands beside a name and changes nothing of what it means here.
_FILLERS = words("beside")
_BESIDE_FORCE = words("depth_beside_force")
# In brackets behind a name, and no unit.
_REMARKS = frozenset(("measured", "sensor"))
_CALLED = re.compile(r"(?:column|col\.?|spalte|#)?\s*#?\s*(\d{1,3})\b[\s,:_/]*(.*)", re.IGNORECASE)
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?")
_UNIT = re.compile(r"\s*([^\W\d_]+(?:\^-?\d)?(?:/[^\W\d_]+(?:\^-?\d)?)?)")
_LATER_UNIT = re.compile(r"\s*[(\[{]([^()\[\]{}]{1,20})[)\]}]")
_SIGNS: Mapping[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
# A mapping is a line somebody typed; nested calls stay far from Python's limit.
_LONGEST, _DEEPEST = 400, 100

Dims: TypeAlias = tuple[int, ...]
#: Exponents of metre, newton, second, volt and ampere of each kind of quantity that a column may hold.
_DIMS: dict[str, Dims] = {
    "length": (1, 0, 0, 0, 0), "force": (0, 1, 0, 0, 0), "time": (0, 0, 1, 0, 0), "voltage": (0, 0, 0, 1, 0),
    "stiffness": (-1, 1, 0, 0, 0), "compliance": (1, -1, 0, 0, 0), "sensitivity": (1, 0, 0, -1, 0),
    "current sensitivity": (1, 0, 0, 0, -1), "speed": (1, 0, -1, 0, 0), "loading rate": (0, 1, -1, 0, 0),
    "pressure": (-2, 1, 0, 0, 0), "frequency": (0, 0, -1, 0, 0), "dimensionless": (0, 0, 0, 0, 0),
}  # fmt: skip


@dataclass(frozen=True)
class Column:
    """One column of a table, by its index, and the unit that a mapping gives in place of the file's own."""

    index: int
    unit: str = ""


@dataclass(frozen=True)
class _Part:
    """Value of a part of an expression over columns: an array (n,) or a number, in SI, and its dimension."""

    values: FloatArray | float
    dims: Dims

    def joined(self, sign: str, other: _Part, what: str) -> _Part:
        """Return this part ``+``, ``-``, ``*`` or ``/`` another one, with the dimension of the result.

        `what` names the expression in errors: InputError for a sum of unlike dimensions or a division by zero.
        """
        if sign in "+-":
            if self.dims != other.dims:
                raise InputError(
                    f"{what}: {_kind_of(self.dims)} and {_kind_of(other.dims)} cannot be added; check the units"
                )
            return _Part(self.values + (other.values if sign == "+" else -other.values), self.dims)
        if sign == "/" and not np.all(other.values):
            raise InputError(f"{what}: it divides by zero")
        way = 1 if sign == "*" else -1
        dims = tuple(a + way * b for a, b in zip(self.dims, other.dims, strict=True))
        return _Part(self.values * other.values if way == 1 else self.values / other.values, dims)


_Leaf: TypeAlias = Callable[[Column], _Part]
_Node: TypeAlias = Callable[[_Leaf, str], _Part]


@dataclass(frozen=True)
class Asked:
    """What a column mapping gives for one role (depth, force, ...): one column, or a sum or product of several.

    Parameters
    ----------
    columns : tuple of Column
        All columns that occur in it, in order.
    turned : bool
        Whether a minus sign stands in front of a single column.
    node : callable, optional
        Evaluates the sum or product; None for a single column.
    """

    columns: tuple[Column, ...]
    turned: bool = False
    node: _Node | None = None

    @property
    def indices(self) -> list[int]:
        """Indices of the columns."""
        return [column.index for column in self.columns]

    def values(
        self, column: Callable[[Column], FloatArray], unit_of: Callable[[Column], str], kind: str, what: str
    ) -> FloatArray:
        """Evaluate the sum or product of columns, in SI, (n,).

        Parameters
        ----------
        column, unit_of : callable
            Values (n,) of a column as written, and its unit; empty for a bare number.
        kind : str
            Kind of quantity that the result must be: ``length``, ``force`` or ``time``.
        what : str
            Name of the expression in error messages.

        Raises
        ------
        InputError
            If lengths are added to forces, or something is divided by zero.
        UnitError
            If the unit of a column is not known, or what comes out is of another kind.
        """

        def leaf(one: Column) -> _Part:
            unit = unit_of(one)
            of = kind_named(unit) if unit else "dimensionless"
            if of not in _DIMS:
                raise UnitError(f"{what}: the unit {unit!r:.40} of a column in it is not known")
            return _Part(column(one) * (unit_factor(unit, of) if unit else 1.0), _DIMS[of])

        found = self.node(leaf, what) if self.node else leaf(self.columns[0])
        if found.dims != _DIMS[kind]:
            raise UnitError(
                f"{what} gives {_kind_of(found.dims)}, but a {kind} is needed; check its columns and units"
            )
        return np.asarray(found.values)


def _kind_of(dims: Dims) -> str:
    return next((f"a {kind}" for kind, known in _DIMS.items() if known == dims), "something else")


def check_mapping(mapping: Mapping[str, str | int] | None) -> None:
    """Refuse a column mapping of the caller that cannot be one.

    Raises
    ------
    InputError
        If it names something else than a role (`ROLES`), or a role is given nothing.
    """
    for role, name in (mapping or {}).items():
        if role not in ROLES:
            raise InputError(f"a column mapping has no {role!r}; it takes {', '.join(ROLES)}")
        if not str(name).strip(" -") or len(str(name)) > _LONGEST:
            raise InputError(
                f"the column for {role!r} must be a name such as 'h (nm)'; got {str(name)!r:.80}"
            )


def name_of(label: str) -> str:
    """Name of a column for comparison: without its unit, in small letters, no accents, blanks for underscores."""
    name, unit = split_label(label)
    return " ".join(
        re.sub(r"[_()\[\]<>:=-]+", " ", plain(label if unit.lower() in _REMARKS else name)).split()
    )


def bare_name(name: str) -> str:
    """Name without words that do not change what it is, such as "axial", "measured" or "corrected"."""
    return " ".join(word for word in name.split() if word not in _FILLERS) or name


def find_columns(labels: Sequence[str], mapping: Mapping[str, str | int] | None = None) -> dict[str, int]:
    """Find the index of the column of each role (``depth``, ``force``, ``time``, ...) that a table has.

    For a sum or product it is the index of the first column in it.

    Parameters
    ----------
    labels : sequence of str
        The header, names with or without units.
    mapping : mapping of role to name, optional
        As ``{"depth": "h (nm)", "force": "-Fz"}``; the sign is ignored here. Roles that it leaves out are found
        by the names that are known.

    Raises
    ------
    InputError
        If a sum or product in the mapping cannot be read.
    """
    mapping = mapping or {}
    known = _known_columns(tuple(label[:_LONGEST] for label in labels))
    found = {role: index for role, index in known.items() if role not in mapping}
    parsed = {role: parse_column(str(wanted), labels) for role, wanted in mapping.items()}
    return found | {role: asked.indices[0] for role, asked in parsed.items() if asked is not None}


@lru_cache(maxsize=64)
def _known_columns(labels: tuple[str, ...]) -> Mapping[str, int]:
    """Find the column of each role by known names: best name first, then a unit of the right kind, then order."""
    names = [name_of(label) for label in labels]
    kinds = [kind_named(split_label(label)[1]) for label in labels]
    found: dict[str, int] = {}
    for role, known in KNOWN.items():
        wanted = ("length", "voltage") if role == "deflection" else (ROLES.get(role) or "length",)
        for called in (names, [bare_name(name) for name in names]):
            for candidate in (*known, *(KNOWN["deflection"] if role == "force" else ())):
                if candidate not in called:
                    continue
                there = [at for at, name in enumerate(called) if name == candidate]
                chosen = [at for kind in wanted for at in there if kinds[at] == kind]
                # A deflection is a force where its unit says so.
                if role != "force" or candidate in known:
                    chosen += [at for at in there if kinds[at] in (None, "dimensionless")]
                    chosen += there if len(there) == 1 and role != "deflection" else []
                if chosen:
                    found.setdefault(role, chosen[0])
    if "force" in found and not found.keys() & {"depth", "travel", "height"}:
        beside = [at for at, label in enumerate(labels) if split_label(label)[0].strip() in _BESIDE_FORCE]
        if len(beside) == 1 and kinds[beside[0]] in ("length", None):
            found["depth"] = beside[0]
    return found


def unread(labels: Sequence[str], found: Mapping[str, int], asked: Mapping[str, str]) -> tuple[str, ...]:
    """Return notes on columns that are not read though they may be the ones that were meant.

    These are columns of the same name as one that is read, or of another known name for the same role.

    Parameters
    ----------
    labels : sequence of str
        The header.
    found, asked : mapping
        Index of the column that is read for each role, and the column mapping of the caller.
    """
    names = [plain(split_label(label)[0]) for label in labels]
    units = [split_label(label)[1] for label in labels]
    same: list[str] = []
    other: list[str] = []
    for role, index in found.items():
        label, name = labels[index].strip(), names[index]
        namesakes = [
            labels[at].strip()
            for at in range(len(labels))
            if names[at] == name
            and at != index
            and len({kind_named(unit) for unit in (units[at], units[index]) if unit}) < 2
        ]
        chosen = plain(asked.get(role, "").strip().removeprefix("-")) == plain(label)
        if role in ROLES and namesakes and (label in namesakes or not chosen):
            same.append(
                f"the {role} is read from the first column of its name, {label!r}; not read: "
                f"{', '.join(map(repr, namesakes))}. Choose by the whole name in columns, or split a file that "
                "holds several tests side by side"
            )
        known = KNOWN[role] if role in {"depth", "force", "time"} and role not in asked else ()
        rivals = [labels[at].strip() for at, one in enumerate(names) if one in known and one != name]
        if rivals and name in known:
            other.append(
                f"the {role} is read from {label!r:.80}; not read: {names_there(rivals)}, which may be one too. "
                "Say which in columns"
            )
    return (*same, *other)


def parse_column(text: str, labels: Sequence[str]) -> Asked | None:
    """Parse one entry of a column mapping: a column, or a sum or product; None if a name is not in the table.

    Parameters
    ----------
    text : str
        As a caller wrote it: a name, ``"2 (nm)"`` for a number, or ``"ramp - deflection"``.
    labels : sequence of str
        The header, names with or without units.

    Raises
    ------
    InputError
        If it is a sum or a product that cannot be read.
    """
    stripped = text.strip()
    turned, bare = stripped.startswith("-"), stripped.removeprefix("-").strip()
    index = _named(bare, labels)
    if index is not None:
        return Asked((Column(index, split_label(bare)[1]),), turned)
    numbered = _CALLED.fullmatch(bare)
    unit = unit_named(numbered[2].strip().strip("()[]{}").removeprefix("in ").strip()) if numbered else ""
    if numbered and (not unit or kind_named(unit) is not None):
        index = int(numbered[1]) - 1
        return Asked((Column(index, unit),), turned) if 0 <= index < len(labels) else None
    if not re.search(r"[-+*/]", bare):
        return None
    return _expression(stripped, labels)


def _named(text: str, labels: Sequence[str]) -> int | None:
    name = plain(split_label(text)[0])
    for of in (plain, lambda label: plain(split_label(label)[0]), name_of):
        for wanted in (plain(text), name, name_of(text)):
            for index, label in enumerate(labels):
                if label.strip() and of(label) == wanted:
                    return index
    return None


def _expression(text: str, labels: Sequence[str]) -> Asked | None:
    """Parse a sum or product of columns; None if a name in it is not one of the table.

    Names and numbers with units are found first, since they hold blanks and signs. What remains are signs and
    brackets about them, of which Python's own parser makes a tree.
    """
    forms = (plain, lambda label: plain(split_label(label)[0]), name_of, lambda one: bare_name(name_of(one)))
    pairs = [(of(label), index) for of in forms for index, label in enumerate(labels)]
    # The longest first: a name may hold another, or a sign.
    names = sorted((pair for pair in pairs if pair[0]), key=lambda pair: -len(pair[0]))
    leaves: list[Column | _Part] = []
    code, at = "", 0
    while at < len(text):
        rest = plain(text[at:]) if text.isascii() else text[at:].lower()
        if text[at].isspace() or text[at] in "+-*/()":
            code, at = code + (text[at].strip() or " "), at + 1
            continue
        found = next((one for one in names if rest.startswith(one[0]) and _ends(rest, len(one[0]))), None)
        if found is not None:
            index, at = found[1], at + len(found[0])
        elif numbered := re.match(r"#\s*(\d{1,3})", rest):
            index, at = int(numbered[1]) - 1, at + numbered.end()
            if not 0 <= index < len(labels):
                raise _refused(text, f"column {index + 1} of {len(labels)}")
        elif number := _NUMBER.match(text, at):
            value, kind, at = _quantity(text, number)
            leaves.append(_Part(value, _DIMS[kind]))
            code += f" x{len(leaves) - 1} "
            continue
        else:
            return None
        unit = _LATER_UNIT.match(text, at)
        if unit is not None and kind_named(unit_named(unit[1])) is not None:
            at = unit.end()
            leaves.append(Column(index, unit_named(unit[1])))
        else:
            leaves.append(Column(index))
        code += f" x{len(leaves) - 1} "
    try:
        flat = code.count("(") + code.count("-") < _DEEPEST
        node = _node(ast.parse(code.strip(), mode="eval").body, leaves) if flat else None
    except SyntaxError:
        node = None
    if node is None:
        raise _refused(text, "its signs or brackets")
    columns = tuple(leaf for leaf in leaves if isinstance(leaf, Column))
    return Asked(columns, node=node) if columns else None


def _node(tree: ast.expr, leaves: Sequence[Column | _Part]) -> _Node | None:
    """Evaluates a tree of ``+ - * /`` over leaves ``x0``, ``x1``, ...; None if it holds anything else."""
    if isinstance(tree, ast.Name):
        leaf = leaves[int(tree.id[1:])]
        return lambda value, _: value(leaf) if isinstance(leaf, Column) else leaf
    left: _Node | None
    if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.USub):
        sign, left, right = "*", _minus, _node(tree.operand, leaves)
    elif isinstance(tree, ast.BinOp) and type(tree.op) in _SIGNS:
        sign, left, right = _SIGNS[type(tree.op)], _node(tree.left, leaves), _node(tree.right, leaves)
    else:
        return None
    if left is None or right is None:
        return None
    return lambda value, what: left(value, what).joined(sign, right(value, what), what)


def _minus(*_: object) -> _Part:
    return _Part(-1.0, _DIMS["dimensionless"])


def _quantity(text: str, number: re.Match[str]) -> tuple[float, str, int]:
    """A number with its unit, if it has one: its value in SI, its kind, and where it ends in the text."""
    unit = _UNIT.match(text, number.end())
    if unit is None:
        return float(number[0]), "dimensionless", number.end()
    for symbol in (unit[1], unit[1].partition("/")[0]):
        kind = kind_named(unit_named(symbol))
        if kind in _DIMS:
            value = float(number[0]) * unit_factor(unit_named(symbol), kind)
            return value, kind, unit.start(1) + len(symbol)
    raise _refused(text, f"the unit {unit[1]!r:.40}")


def _refused(text: str, what: str) -> InputError:
    return InputError(
        f"columns: {text!r:.120} is not understood: {what}; write names of columns and numbers with units, joined "
        "by + - * / and brackets, as 'ramp - deflection' or 'volts * 41 nm/V * 0.06 N/m'"
    )


def _ends(text: str, at: int) -> bool:
    """Whether a word ends before position `at` of a text: no letter, digit or underscore stands there."""
    return not (text[at : at + 1].isalnum() or text[at : at + 1] == "_")
