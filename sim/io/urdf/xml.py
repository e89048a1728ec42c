"""Element: an element of an XML file with its line, so that every error can point at it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from solvers.types import Floats

_HUGE = 1e30  # no quantity of a robot; cubes of smaller numbers are finite


class UrdfError(ValueError):
    """A URDF file that cannot be read, or a robot that cannot be simulated; names the file, the line, the element."""


@dataclass
class Element:
    """One XML element."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[Element] = field(default_factory=list)

    def error(self, problem: str) -> UrdfError:
        """The error to raise about this element."""
        name = self.attributes.get("name")
        shown = f"<{self.tag} name={name!r}>" if name is not None else f"<{self.tag}>"
        return UrdfError(f"load_urdf: {self.file}, line {self.line}, {shown}: {problem}")

    def all(self, tag: str) -> list[Element]:
        """Direct children of that tag."""
        return [e for e in self.children if e.tag == tag]

    def one(self, tag: str) -> Element | None:
        """The only child of that tag, or None; a second one is refused unless it says the same."""
        found = self.all(tag)
        for other in found[1:]:
            if other.attributes != found[0].attributes or other.children or found[0].children:
                raise other.error(f"a second <{tag}> in the <{self.tag}> of line {self.line}")
        return found[0] if found else None

    def need(self, tag: str) -> Element:
        """The only child of that tag, which must be there."""
        found = self.one(tag)
        if found is None:
            raise self.error(f"expected a <{tag}> inside")
        return found

    def text(self, attribute: str) -> str:
        """An attribute that must be there and not be empty."""
        value = self.attributes.get(attribute, "").strip()
        if not value:
            raise self.error(f'expected an attribute {attribute}="..."')
        return value

    def vector(self, attribute: str, length: int, default: tuple[float, ...] | None = None) -> Floats:
        """`length` finite numbers, separated by blanks."""
        return np.array(self._numbers(attribute, length, default), dtype=np.float64)

    def number(self, attribute: str, default: float | None = None) -> float:
        """One finite number."""
        return self._numbers(attribute, 1, None if default is None else (default,))[0]

    def _numbers(self, attribute: str, length: int, default: Sequence[float] | None) -> Sequence[float]:
        if attribute not in self.attributes and default is not None:
            return default
        text = self.text(attribute)
        # Python also reads "1_000" and the digits of every script, which are not numbers in XML
        plain = text.isascii() and "_" not in text
        try:
            values = [float(word) for word in text.split()] if plain else []
        except ValueError:
            values = []
        if len(values) != length or not all(abs(value) < _HUGE for value in values):
            expected = "a finite number" if length == 1 else f"{length} finite numbers"
            hint = "; this is a xacro file, run xacro on it first" if "${" in text or "$(" in text else ""
            raise self.error(f"{attribute}={text!r}: expected {expected}{hint}")
        return values


def parse(path: Path) -> Element:
    """The root element of an XML file.

    Blanks and line ends before the XML declaration and NUL bytes after the root are passed over: files in the wild have
    them, and they mean nothing.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise type(error)(error.errno, f"load_urdf: {error.strerror}", str(path)) from None
    text = text.removeprefix(b"\xef\xbb\xbf").rstrip(b"\0 \t\r\n")
    body = text.lstrip()
    skipped = text[: len(text) - len(body)].count(b"\n")
    return _Builder(path.name, skipped).build(body)


class _Builder:
    """Handlers of the expat parser."""

    def __init__(self, file: str, skipped: int) -> None:
        self.file, self.skipped = file, skipped
        self.open: list[Element] = []
        self.root: Element | None = None
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end

    def build(self, text: bytes) -> Element:
        try:
            self.parser.Parse(text, True)
        except expat.ExpatError as error:
            inside = f", inside the <{self.open[-1].tag}> of line {self.open[-1].line}" if self.open else ""
            raise UrdfError(
                f"load_urdf: {self.file}, line {error.lineno + self.skipped}{inside}: not XML: "
                f"{expat.ErrorString(error.code)}"
            ) from None
        if self.root is None:
            raise UrdfError(f"load_urdf: {self.file}: no XML element")
        return self.root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, self.file, self.parser.CurrentLineNumber + self.skipped)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def _end(self, tag: str) -> None:
        self.open.pop()
