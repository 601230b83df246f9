"""Lines that someone types at a terminal."""

from __future__ import annotations

import contextlib
import os
import threading
from pathlib import Path

from prompt_toolkit import PromptSession, print_formatted_text
from prompt_toolkit.history import FileHistory, History, InMemoryHistory

from hypermap.console.commands import Console
from hypermap.console.completion import ConsoleCompleter


class Prompt:
    """Asks for lines; the Tab key completes, the arrow keys bring back earlier lines.

    It may be used in any one thread, and closed from any other.
    """

    def __init__(self, console: Console) -> None:
        self._session: PromptSession[str] = PromptSession(
            history=history(), completer=ConsoleCompleter(console), complete_while_typing=False
        )
        self._is_closed = False

    def line(self) -> str:
        """Return the next line.

        Raises:
            EOFError: At the end of input (Ctrl-D), and when the prompt was closed.
            KeyboardInterrupt: On Ctrl-C.
        """
        return self._session.prompt(
            "hypermap> ",
            handle_sigint=threading.current_thread() is threading.main_thread(),
            pre_run=self._end_if_closed,
        )

    def say(self, text: str) -> None:
        """Write a text between two lines."""
        print_formatted_text(text)

    def close(self) -> None:
        """End `line`, now and later; the terminal is as it was before."""
        self._is_closed = True
        loop = self._session.app.loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # it has just ended by itself
                loop.call_soon_threadsafe(self._end_if_closed)

    def _end_if_closed(self) -> None:
        app = self._session.app
        if self._is_closed and app.is_running and not app.is_done:
            app.exit(exception=EOFError)


def history() -> History:
    """Return the lines of earlier sessions, from where the system keeps such files."""
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    try:
        (state / "hypermap").mkdir(parents=True, exist_ok=True)
        (state / "hypermap" / "history").touch()
    except OSError:
        return InMemoryHistory()
    return FileHistory(str(state / "hypermap" / "history"))
