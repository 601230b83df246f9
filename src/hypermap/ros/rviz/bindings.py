"""An rviz window that takes commands on standard input, one line of JSON at a time.

It runs on the Python that rviz's bindings are for, so it imports nothing but those:

- {"do": "load", "config": TEXT}: take a whole configuration, instead of all there is.
- {"do": "put", "name": NAME, "class": CLASS, "config": TEXT, "open": [PROPERTY, ...]}: add a
  display, instead of one of that name, and open it in the panel to show these of its properties.
- {"do": "remove", "name": NAME}: remove a display.
- {"do": "view", "config": TEXT}: look elsewhere; TEXT is what a `.rviz` file has as Views.
- {"do": "frame", "frame": NAME}: set the fixed frame.

Configurations are YAML, as in a `.rviz` file. The end of the input closes the window.
"""

from __future__ import annotations

import contextlib
import json
import queue
import sys
import threading
from typing import Any

from python_qt_binding.QtCore import QTimer
from python_qt_binding.QtWidgets import QApplication
from rviz import bindings as rviz

_PERIOD = 50  # ms between looks at the input


class DisplayFrame(rviz.VisualizationFrame):  # type: ignore[misc]
    """The window, and the displays that it should show."""

    def __init__(self) -> None:
        super().__init__()
        self.setSplashPath("")
        self.initialize()
        self._displays: dict[str, Any] = {}

    def closeEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Close without a question: there is no file that changes would belong to."""
        self.setWindowModified(False)
        super().closeEvent(event)

    def obey(self, order: dict[str, Any]) -> None:
        """Do what one line says."""
        what = order.pop("do")
        if what == "load":
            self.load(_parsed(order["config"]))
            group = self.getManager().getRootDisplayGroup()
            shown = [group.getDisplayAt(place) for place in range(group.numDisplays())]
            self._displays = {display.getName(): display for display in shown}
        elif what == "put":
            self.put(order["name"], order["class"], order["config"], order["open"])
        elif what == "remove":
            self.remove(order["name"])
        elif what == "view":
            self.getManager().getViewManager().load(_parsed(order["config"]))
        elif what == "frame":
            self.getManager().setFixedFrame(order["frame"])
        self.setWindowModified(False)

    def put(self, name: str, class_name: str, config: str, opened: list[str]) -> None:
        """Add a display, or change the one of that name, as rviz may crash where one goes."""
        display: Any = self._displays.get(name)
        try:
            is_there = display is not None and display.getClassId() == class_name
        except RuntimeError:  # the user has removed it: Qt's object is gone
            is_there = False
        if not is_there:
            self.remove(name)
            display = self.getManager().createDisplay(class_name, name, True)
        display.load(_parsed(config))
        for name_of_property in opened:
            display.expand()
            display.subProp(name_of_property).expand()
        self._displays[name] = display

    def remove(self, name: str) -> None:
        """Remove a display, unless the user has done so."""
        display = self._displays.pop(name, None)
        if display is None:
            return
        with contextlib.suppress(RuntimeError):  # Qt's object is gone
            display.setEnabled(False)
            self.getManager().getRootDisplayGroup().takeDisplay(display)
            display.deleteLater()


def _parsed(text: str) -> Any:
    config = rviz.Config()
    rviz.YamlConfigReader().readString(config, text)
    return config


def main() -> int:
    """Show the window until it or the input is closed."""
    application = QApplication([sys.argv[0]])
    window = DisplayFrame()
    orders: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            orders.put(line)
        orders.put(None)

    def work() -> None:
        # One order at a time: rviz may crash where displays go that it has not drawn yet.
        if orders.empty():
            return
        line = orders.get()
        if line is None:
            window.close()
            application.quit()
            return
        window.obey(json.loads(line))
        window.show()

    timer = QTimer()
    timer.timeout.connect(work)
    timer.start(_PERIOD)
    threading.Thread(target=read, daemon=True).start()
    return int(application.exec_())


if __name__ == "__main__":
    sys.exit(main())
