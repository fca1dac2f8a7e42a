"""The house of the project: imports go down only, and each third party lives in one place."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from support import count_house

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "underlay"

#: Floors from the ground up; a module may import from its own floor and from below. The browser page (`app`)
#: stands on the floor of the command line.
FLOORS = ("base", "mechanics", "scene", "data", "inference", "report", "cli")
GROUND = {
    "errors",
    "units",
    "quantities",
    "_arrays",
    "_csv",
    "_door",
    "_files",
    "_given",
    "_text",
    "_threads",
    "_version",
    "plugins",
}

#: Third parties and the only modules (relative to the package, by prefix) that may import them.
HOMES = {
    "lmfit": ("inference/least_squares", "inference/answer_cost"),
    "emcee": ("inference/sampling/run", "inference/sampling/diagnostics"),
    "dask": ("inference/batch/processes",),
    "distributed": ("inference/batch/processes",),
    "matplotlib": ("report/plots", "report/notebook"),
    "pint": ("units",),
    "threadpoolctl": ("_threads",),
    "tomlkit": ("scene/scene_writer",),
    "xlsxwriter": ("report/excel",),
    "typer": ("cli",),
    "nicegui": ("app/server", "app/pages"),
    "starlette": ("app/security",),
    "rich": ("cli", "inference/progress", "inference/sampling/run", "inference/batch/fit_many"),
}


def name_of(path):
    return path.relative_to(PACKAGE).with_suffix("").as_posix()


def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def modules():
    """Every module of the package by its name, parsed once."""
    return {name_of(path): parsed(path) for path in sorted(PACKAGE.rglob("*.py"))}


def floor_of(name):
    head = name.split("/")[0]
    if head in {"__init__", "__main__"}:
        return len(FLOORS)
    if head in GROUND:
        return 0
    return FLOORS.index("cli" if head.startswith("cli") or head == "app" else head)


def imported(tree):
    """(module, is it under TYPE_CHECKING) for every import in a module, wherever it stands."""
    typing_only = {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and ast.unparse(branch.test) == "TYPE_CHECKING"
        for statement in branch.body
        for node in ast.walk(statement)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, id(node) in typing_only
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import: {ast.unparse(node)}"
            for alias in node.names:
                # `from underlay.data.readers import optics11` imports a module, not a name of the package.
                inner = PACKAGE.parent / f"{node.module}.{alias.name}".replace(".", "/")
                is_module = inner.is_dir() or inner.with_suffix(".py").is_file()
                yield f"{node.module}.{alias.name}" if is_module else node.module, id(node) in typing_only


@pytest.fixture(scope="module")
def imports(modules):
    """What each module imports, as `imported` says it."""
    return {name: list(imported(tree)) for name, tree in modules.items()}


def upward(name, found):
    """Imports of a module that do not go down."""
    here = floor_of(name)
    for module, _ in found:
        if module == "underlay":
            if here < FLOORS.index("cli"):
                yield f"{name} imports the whole package"
        elif (
            module.startswith("underlay.")
            and floor_of(module.removeprefix("underlay.").replace(".", "/")) > here
        ):
            yield f"{name} imports upward: {module}"


def astray(name, found):
    """Third parties that a module imports outside their home."""
    for module, typing_only in found:
        homes = HOMES.get(module.split(".")[0])
        if homes is not None and not typing_only and not name.startswith(homes):
            yield f"{name} imports {module}; its home is {homes}"


def test_imports_go_down_only(imports):
    assert not [line for name, found in imports.items() for line in upward(name, found)]


def test_the_page_and_the_commands_stand_side_by_side(imports):
    """Neither is made of the other; one command opens the page."""
    across = {
        (name, module)
        for name, found in imports.items()
        for module, _ in found
        for here, there in (("app/", "underlay.cli"), ("cli/", "underlay.app"))
        if name.startswith(here) and module.startswith(there)
    }
    assert across == {("cli/start", "underlay.app.server")}


def test_third_parties_live_in_one_place(imports):
    assert not [line for name, found in imports.items() for line in astray(name, found)]


def test_the_search_for_imports_finds_them():
    tree = ast.parse(
        "import lmfit\nfrom underlay.report import tables\nimport underlay\ndef f():\n    import emcee\n"
    )
    found = list(imported(tree))
    assert len(list(upward("mechanics/laws", found))) == 2
    assert len(list(astray("mechanics/laws", found))) == 2
    assert not list(upward("cli/app", found))


def test_no_import_circles(imports):
    graph = {
        # Annotations count: what two modules say of each other they cannot say apart.
        "underlay." + name.replace("/", ".").removesuffix(".__init__"): {
            module for module, _ in found if module.startswith("underlay.")
        }
        for name, found in imports.items()
    }
    done, trail = set(), []

    def visit(name):
        if name in done:
            return
        assert name not in trail, " -> ".join([*trail[trail.index(name) :], name])
        trail.append(name)
        for module in graph.get(name, ()):
            visit(module)
        done.add(trail.pop())

    for name in graph:
        visit(name)


def test_mechanics_needs_numpy_and_scipy_only():
    code = (
        "import sys, pkgutil, importlib, types\n"
        f"package = types.ModuleType('underlay'); package.__path__ = [{str(PACKAGE)!r}]\n"
        "sys.modules['underlay'] = package\n"
        "import underlay.mechanics\n"
        "for module in pkgutil.walk_packages(underlay.mechanics.__path__, 'underlay.mechanics.'):\n"
        "    importlib.import_module(module.name)\n"
        "heavy = {'lmfit', 'matplotlib', 'pandas', 'emcee', 'pint', 'typer'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


#: Where code of the caller's own runs, whatever it raises becomes a `LawError` that names it.
SEAMS = {"contact_law.py", "solver.py"}


def test_no_hidden_failures_in_mechanics():
    for path in (PACKAGE / "mechanics").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for word in ("errstate", "nan_to_num", "np.clip(", "except Exception", "except:"):
            seam = word == "except Exception" and path.name in SEAMS
            assert seam or word not in text, f"{path.name} holds {word}"


#: What opens a file, or parses what came from one without bounds: the last part of the call's name.
OPENS = {
    "open", "fdopen", "FileIO", "read_text", "read_bytes", "read_csv", "read_parquet", "ParquetFile", "read_excel",
    "load_workbook", "open_workbook", "ZipFile", "connect", "genfromtxt", "loadtxt", "fromfile", "memmap",
}  # fmt: skip
OPENS_DOTTED = {
    "np.load",
    "json.load",
    "json.loads",
    "tomllib.load",
    "tomllib.loads",
    "h5py.File",
    "library.File",
}
#: The only modules that call them, and why; `_door` checks a file, the others get bytes of it or write.
DOORS = {
    "app/server": {"webbrowser.open"},  # opens a browser
    "app/results": {"zipfile.ZipFile"},  # writes into memory
    "_door": {"os.open", "io.FileIO", "json.loads", "tomllib.loads", "zipfile.ZipFile", "archive.open"},
    "_files": {"os.open", "os.fdopen"},  # writes
    "data/export": {"h5py.File"},  # writes into memory
    "data/readers/_hdf5": {
        "h5py.File",
        "h5py.h5a.open",
        "h5py.h5o.open",
    },  # in memory, or after opened; what is in it
    "data/readers/workbooks": {"openpyxl.load_workbook", "xlrd.open_workbook"},  # bytes in memory
    "data/readers/jpk": {"zipfile.ZipFile"},  # after opened
    "data/readers/_text": {"np.loadtxt", "read_text"},  # lines in memory; a file of the package itself
    "inference/batch/results_table": {"temporary.open", "parquet.ParquetFile"},  # writes; bytes in memory
    "inference/journal": {"sqlite3.connect", "json.loads"},  # its own guard
    "inference/batch/decisions": {"pd.read_csv"},  # text in memory
    "inference/citation": {"read_text"},  # of the package itself
    "mechanics/published/law": {"read_text"},  # of the package itself
    "mechanics/stiffening/factors": {"read_text"},  # a file of the package itself
    "mechanics/exact/stored_curves": {"np.load"},  # of the package itself
    "mechanics/biphasic/tables": {"np.load"},  # of the package itself
    "cli/start": {"read_text"},  # of the package itself
    "report/page": {"read_text"},  # of the package itself
    "report/screen": {"read_text"},  # of the package itself
    "scene/parameters": {"read_text"},  # of the package itself
    "scene/scene_keys": {"read_text"},  # of the package itself
    "report/notebook": {"read_text", "open"},  # of the package itself; writes a log
}


def opening_calls(tree):
    """Dotted name, as far as it is one, of every call in a module that opens or parses a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
            name = ast.unparse(node.func)
            last = name.rpartition(".")[2]
            # A bare name but `open` is a function of the door.
            if name in OPENS_DOTTED or name == "open" or (last in OPENS and name != last):
                yield name if name.replace(".", "").replace("_", "").isalnum() else last


def test_files_come_in_through_one_door(modules):
    found = {name: set(opening_calls(tree)) - DOORS.get(name, set()) for name, tree in modules.items()}
    assert not {name: calls for name, calls in found.items() if calls}


def test_the_search_for_open_files_finds_them():
    text = "open(p)\nPath(p).read_bytes()\nnp.load(p)\npd.read_csv(p)\nf.opened(p)\njson.dumps(p)\n"
    assert set(opening_calls(ast.parse(text))) == {"open", "read_bytes", "np.load", "pd.read_csv"}


#: What outlives its callers, and where it is argued why.
KEPT_FOR_THE_PROCESS = {
    "mechanics/exact/nodes": {"TABLES"},
    # Functions of nothing but their own numbers, made when first asked for.
    "inference/uncertainty/columns": {"_eigenvectors"},
    "inference/uncertainty/hypotheses": {"_choices"},
    "mechanics/finite_width": {"_splines"},
    "mechanics/published/law": {"published_corrections"},
    "mechanics/stiffening/factors": {"_near", "finite_elements"},
    "mechanics/biphasic/tables": {"shipped_punch", "shipped_tip"},
    "plugins": {"plugins"},
    # What the letters of a name of a column say: a bounded number, which every file of a kind asks for again.
    "data/readers/_text": {"_split_label", "kind_named"},
    "data/readers/_columns": {"_known_columns"},
}
CACHES = {"cache", "lru_cache"}
#: Calls that make something to be filled.
CONTAINERS = {
    "dict",
    "list",
    "set",
    "OrderedDict",
    "defaultdict",
    "deque",
    "Counter",
    "local",
    "TableStore",
}


def kept_for_the_process(tree):
    """Names of a module that caches or containers filled later are bound to, and functions that write globals."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Global):
            yield from node.names
        if isinstance(node, ast.FunctionDef):
            marks = (mark.func if isinstance(mark, ast.Call) else mark for mark in node.decorator_list)
            if any(ast.unparse(mark).rpartition(".")[2] in CACHES for mark in marks):
                yield node.name
    for node in tree.body:
        # A name that is declared a Mapping is not written to: mypy holds that.
        fixed = isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation).startswith("Mapping")
        named = isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None
        if named and not fixed and is_to_be_filled(node.value):
            yield ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target)


def is_to_be_filled(value):
    """Whether an expression makes a container that is empty, or the store of the tables."""
    if isinstance(value, ast.Call):
        made = ast.unparse(value.func).rpartition(".")[2]
        return made in CONTAINERS and (not value.args or made == "TableStore")
    return (isinstance(value, ast.Dict) and not value.keys) or (
        isinstance(value, ast.List) and not value.elts
    )


def test_one_store_outlives_its_callers(modules):
    found = {name: set(kept_for_the_process(tree)) for name, tree in modules.items()}
    assert {name: names for name, names in found.items() if names} == KEPT_FOR_THE_PROCESS


def test_the_search_for_caches_finds_them():
    text = (
        "A = {}\nB: dict = dict()\nF: Mapping = {}\nC = {1: 2}\nD = OrderedDict()\nE = frozenset({1})\n"
        "@lru_cache(maxsize=3)\ndef f():\n    global g\n@functools.cache\ndef h(): ...\n"
    )
    assert set(kept_for_the_process(ast.parse(text))) == {"A", "B", "D", "f", "g", "h"}


def test_the_house_grows_no_further():
    """The ratchet: what `count_house` counts may only fall; a change that lowers a figure writes it down."""
    known = json.loads(count_house.FIGURES.read_text(encoding="utf-8"))
    found = count_house.figures()
    assert set(found) == set(known)
    grown = {name: (known[name], value) for name, value in found.items() if value > known[name]}
    assert not grown, f"was, is: {grown}; delete, or say in the change why it must grow"


def test_the_count_of_the_house_counts():
    text = '"""Doc."""\nA = 1.0\nB = (2, "x")  # why\n\ndef f():\n    """Doc."""\n    return isinstance(A, Cone)\n'
    file = count_house.File("x", text)
    assert (file.code_lines, file.numbers, count_house.asks_for_tips(file)) == (4, 2, 1)
    assert count_house.names_an_effect(
        count_house.File("x", "Prony(1)"), ("mechanics/viscoelastic",), ("Prony",)
    )
