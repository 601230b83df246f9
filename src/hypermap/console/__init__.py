"""The console of the map server, for the shell of the command line and for nodes.

`commands` takes a line of text and returns the answer; it knows no terminal. `prompt` brings what
someone types at a terminal, and `completion` what the Tab key offers there.
"""

from hypermap.console.commands import COMMANDS, Command, Console, Leave, split

__all__ = ["COMMANDS", "Command", "Console", "Leave", "split"]
