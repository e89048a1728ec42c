"""The rooms of the house: layers without circles, few entries, one name for one thing."""

from __future__ import annotations

import ast
import re
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterable

import pytest

from support.modules import ROOT, circles, code_of, files_of, imports, module_name, modules, nodes_of, tree_of
from support.programs import PACKAGES

PLACES = ("benchmarks", "dojo_opt", "examples", "sim", "solvers", "tests")


def test_a_circle_is_found() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]


def test_imports_have_no_circle() -> None:
    assert circles(imports()) == []


@pytest.mark.parametrize(("package", "most"), [("sim", 12), ("dojo_opt", 20), ("solvers", 20)])
def test_few_entries_at_the_top(package: str, most: int) -> None:
    entries = [path.name for path in (ROOT / package).iterdir() if path.name != "__pycache__"]
    assert len(entries) <= most, sorted(entries)


def test_every_room_says_its_purpose() -> None:
    for file, module in modules().items():
        if file.name == "__init__.py":
            assert ast.get_docstring(module), file


def test_no_file_name_is_used_more_than_twice() -> None:
    names = Counter(file.name for file in files_of(*PLACES))
    assert [name for name, count in names.items() if count > 2 and name != "__init__.py"] == []


def test_no_class_name_is_used_twice() -> None:
    classes = defaultdict(list)
    for file in files_of(*PLACES):
        for name in re.findall(r"^ *class (\w+)", code_of(file), re.MULTILINE):
            classes[name].append(module_name(file))
    assert len(classes) > 500
    assert {name: where for name, where in classes.items() if len(where) > 1} == {}


VERBS = "|".join(
    "custom discret factor general global ideal initial linear local maxim minim normal optim organ parallel parametr "
    "penal quant random real regular serial special stabil summar symmetr synchron util vector visual".split()
)
BRITISH = re.compile(
    rf"(?:{VERBS})is(?:e|ed|es|er|ing|ation|ations)(?![a-z])|colour|behaviour|neighbour|favour|catalogue|grey"
    r"|centre|metre(?!ic)|(?:travel|label|model|cancel|tunnel|signal|level)l(?:ed|ing|er)(?![a-z])"
)


def test_identifiers_have_american_spelling() -> None:
    """Those of Python and NumPy have: one spelling, so that nobody has to remember which. Prose may be British."""
    british = {"normalise", "_centre_of_mass", "Randomisation", "travelled", "catalogue", "optimised_twice"}
    assert all(BRITISH.search(name.lower()) for name in british)
    assert not any(
        BRITISH.search(name) for name in ("noise", "precise", "symmetric", "otherwise", "parametric", "level")
    )
    files = [*files_of(*PLACES), *ROOT.glob("dojo_opt/**/*.pyi")]
    found = {file.name for file in files if BRITISH.search(file.name)}
    for file in files:
        names = set(re.findall(r"\w+", code_of(file)))
        found |= {f"{file.relative_to(ROOT)}: {name}" for name in names if BRITISH.search(name.lower())}
    assert found == set()


Documented = ast.Module | ast.ClassDef | ast.FunctionDef
PARTS_OF_TUPLES = {"_replace", "_asdict", "_fields", "_field_defaults", "_make"}  # public, by Python's documentation


def _foreign_private(module: Iterable[ast.AST]) -> list[str]:
    """Private names that a module takes from objects which are not its own: it never says self._name or cls._name."""
    found, own = [], set()
    for node in module:
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            own.add(node.name)
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.endswith("__"):
            owner = ast.unparse(node.value)
            if owner in ("self", "cls") or owner.startswith("super("):
                own.add(node.attr)
            else:
                found.append((node.attr, f"{node.lineno}: {owner}.{node.attr}"))
    return [text for name, text in found if name not in own | PARTS_OF_TUPLES]


def test_no_module_takes_private_parts_of_others() -> None:
    """But for the compiler, which adapts Numba's. Benchmarks and examples show what a user can reach."""
    assert _foreign_private(ast.walk(ast.parse("def f(x):\n    return x._hidden"))) == ["2: x._hidden"]
    assert _foreign_private(ast.walk(ast.parse("class A:\n    def f(self, x):\n        return self._a + x._a"))) == []
    kinds = (ast.FunctionDef, ast.ClassDef, ast.AsyncFunctionDef, ast.Attribute)
    places = {
        module_name(file): _foreign_private(node for kind in kinds for node in nodes_of(file, kind))
        for file in files_of(*PACKAGES, "benchmarks", "examples")
    }
    assert {name: texts for name, texts in places.items() if texts and not name.startswith("solvers.compiler")} == {}


RANKS = ("solvers", "sim", "dojo_opt", "benchmarks")  # from below


def _named_above(package: str, tree: ast.Module) -> list[str]:
    """Modules of the packages above that strings name, as for `import_module`; docstrings are longer."""
    above = "|".join(RANKS[RANKS.index(package) + 1 :]) or "nothing"
    name = re.compile(rf"(?:{above})(?:\.\w+)*")
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return [text for text in texts if name.fullmatch(text) and "." in text]


def test_no_string_names_a_module_of_a_package_above() -> None:
    """`import_module` of a string would be an import that the contracts do not see."""
    assert _named_above("sim", ast.parse("import_module('dojo_opt.viewer.notebook')")) == ["dojo_opt.viewer.notebook"]
    found = {module_name(file): _named_above(file.relative_to(ROOT).parts[0], tree) for file, tree in modules().items()}
    assert {name: texts for name, texts in found.items() if texts} == {}


def test_files_that_docstrings_name_exist() -> None:
    """A name with folders is a path, in part at least; a bare name is the name of some file."""
    paths = {file.relative_to(ROOT).as_posix() for file in ROOT.glob("*/**/*.py")}
    wrong = []
    for file in modules():
        owners: list[Documented] = [tree_of(file), *nodes_of(file, ast.ClassDef), *nodes_of(file, ast.FunctionDef)]
        for node in owners:
            for name in re.findall(r"(?<![\w/.])(?:\w+/)*\w+\.py\b", ast.get_docstring(node, clean=False) or ""):
                if not any(path == name or path.endswith("/" + name) for path in paths):
                    wrong.append(f"{module_name(file)}: {name}")
    assert wrong == []


def _files_that_name(word: str) -> list[str]:
    """Files of the packages whose names or short strings contain a word: no studies, no tasks, no Meshcat."""
    found = []
    for file in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py*")):
        if {"__pycache__", "report", "tasks"} & set(file.parts) or word not in file.read_text().lower():
            continue
        with open(file, "rb") as lines:
            tokens = [t for t in tokenize.tokenize(lines.readline) if t.type in (tokenize.NAME, tokenize.STRING)]
        before = ["", *(token.string for token in tokens)]
        texts = [t.string for k, t in enumerate(tokens) if len(t.string) < 40 and before[k] != "meshcat"]
        found += [str(file.relative_to(ROOT))] if any(word in text.lower() for text in texts) else []
    return found


@pytest.mark.parametrize("word", ["ellipsoid", "screw"])
def test_a_shape_and_a_joint_are_named_in_few_files(word: str) -> None:
    """With derivatives by its sizes, drawing, and the files of robots that have it."""
    found = _files_that_name(word)
    assert 1 < len(found) <= 8, found
