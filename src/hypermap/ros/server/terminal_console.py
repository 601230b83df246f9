"""The console of the map server on the node's terminal."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from hypermap.console.commands import Console, Leave
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.ros.port import Port, Value
from hypermap.ros.server.current_map import CurrentMap
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.console.prompt import Prompt

_PATIENCE = 5.0  # s for a command to end when the node ends


class TerminalConsole:
    """The part that carries out what someone types where the node was started.

    Without a terminal it does nothing. Ctrl-D ends the console alone; `exit`, `quit` and
    Ctrl-C end the node.
    """

    def __init__(self, port: Port, current: CurrentMap, automap: Callable[[], str]) -> None:
        """Prepare it; `automap` is what the command of that name calls."""
        self._port = port
        self._current = current
        self._automap = automap
        self._completed = Console()  # what the Tab key looks at
        self._prompt: Prompt | None = None
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:  # noqa: ARG002
        """Start to listen to the terminal; afterwards, let the Tab key offer the new layers."""
        self._completed.hypermap = hypermap
        if self._prompt is None and has_terminal():
            from hypermap.console.prompt import Prompt  # which most nodes never need

            self._prompt = Prompt(self._completed)
            self._thread.start()

    def close(self) -> None:
        """Leave the terminal as it was before."""
        if self._prompt is not None:
            self._prompt.close()
            if self._thread.is_alive() and threading.current_thread() is not self._thread:
                self._thread.join(_PATIENCE)

    def _run(self) -> None:
        prompt = self._prompt
        if prompt is None:
            return
        prompt.say("Type help for the commands, exit or quit to end the node.")
        try:
            while True:
                if answer := self._answer(prompt.line()):
                    prompt.say(answer)
        except EOFError:
            self._port.log("info", "the console has ended")
        except (KeyboardInterrupt, Leave):
            self._port.shut_down()

    def _answer(self, line: str) -> str:
        """Carry out a line and return the answer, also if it is an error.

        Raises:
            Leave: If the line is `exit` or `quit`.
        """
        before = self._current.hypermap
        console = Console(before, self._republish, automap=self._automap)
        try:
            answer = console.run(line)
        except (HypermapError, OSError) as error:
            return f"error: {error}"
        if console.hypermap is not before:
            self._current.replace(console.hypermap)
        return answer

    def _republish(self) -> str:
        self._current.show_again()
        return f"published {counted(len(self._current.hypermap.layers), 'layer')} again"


def has_terminal() -> bool:
    """Return whether someone can type: in the background, reading would stop the process."""
    if not (sys.stdin and sys.stdin.isatty() and sys.stdout.isatty()):
        return False
    return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
