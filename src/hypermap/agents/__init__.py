"""Tools with which programs, such as language-model agents, query and edit a map."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.agents.toolbox import tools_for
    from hypermap.agents.tools import Picture, Tool

_HOMES = {
    "Picture": "hypermap.agents.tools",
    "Tool": "hypermap.agents.tools",
    "tools_for": "hypermap.agents.toolbox",
}

__all__ = ["Picture", "Tool", "tools_for"]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
