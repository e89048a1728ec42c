"""Journal: the record of all iterations of a solve, what is printed of it, and when the budget is used up."""

from __future__ import annotations

import time
from typing import Any

from dojo_opt.options import Options
from dojo_opt.plan import HEADER, table_line
from solvers.status import Status


class Journal:
    """One record per iteration, see `dojo_opt.plan.COLUMNS`."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Forget the last solve and start the clock."""
        self.begin = self._tick = time.perf_counter()
        self.records: list[dict[str, Any]] = []
        self._note = ""
        self._headed = False

    def budget(self) -> Status:
        """SOLVED while there is some left."""
        if len(self.records) >= self._options.max_iterations:
            return Status.MAX_ITERATIONS
        if time.perf_counter() - self.begin >= self._options.time_limit:
            return Status.TIME_LIMIT
        return Status.SOLVED

    def note(self, text: str) -> None:
        """Put a line of text into the table, before the next iteration."""
        self._note = text
        self._say(f"     {text}")

    def _say(self, line: str) -> None:
        """Print a line of the table, the first one below the header."""
        if not self._headed:
            self._options.say(HEADER)
        self._headed = True
        self._options.say(line)

    def add(self, **record: Any) -> bool:
        """Record an iteration, print it, call back; True when the callback wants to stop."""
        tock = time.perf_counter()
        record = {"iteration": len(self.records) + 1, **record, "milliseconds": 1e3 * (tock - self._tick)}
        self._tick = tock
        self._say(table_line(record))
        self.records.append(record | {"note": self._note} if self._note else record)
        self._note = ""
        if self._options.callback is not None:
            try:
                self._options.callback(record)
            except StopIteration:
                return True
        return False
