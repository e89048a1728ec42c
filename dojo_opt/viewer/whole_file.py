"""`whole_file`: a file that is written as a whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """The path to write to in place of `path`, whose file it becomes at the end of the block.

    After an exception, such as Ctrl-C, `path` is what it was before. A device or a pipe is written directly, and so is
    a file in a folder where no other can be made.
    """
    target = path.resolve()
    if (target.exists() and not target.is_file()) or not os.access(target.parent, os.W_OK):
        yield path
        return
    part = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")  # its ending tells the kind of a figure
    try:
        yield part
        if target.exists():
            part.chmod(target.stat().st_mode)
        part.replace(target)
    finally:
        with suppress(FileNotFoundError):
            part.unlink()
