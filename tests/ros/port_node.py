"""A node for tests of its life: `port_node.py NAME`."""

from __future__ import annotations

import contextlib
import sys

from hypermap.ros.port import Parameter
from hypermap.ros.ros1.port import Ros1Port


def main() -> None:
    port = Ros1Port(sys.argv[1])
    height = Parameter("height", 0.5, "Height [m].", changes=True)
    values = port.parameters([height], lambda changed: say(f"changed {changed['height']}"))
    text = port.message("std_msgs/String")
    answer = port.response("hypermap_msgs/GetStringAtPoint")

    def say(what: str) -> None:
        sys.stdout.write(f"{what}\n")
        sys.stdout.flush()

    greeting = port.publisher("greeting", "std_msgs/String", latched=True)
    greeting.publish(text("hello"))
    port.subscribe("/port_node_in", "std_msgs/String", lambda message: say(f"heard {message.data}"))
    port.service(
        "ask",
        "hypermap_msgs/GetStringAtPoint",
        lambda request: answer(name=f"you said {request.layer}"),
        lambda text: answer(name=text),
    )
    with contextlib.suppress(KeyboardInterrupt):  # which may come before spin() takes it
        say(f"ready, height {values['height']}")
        port.spin()
    say("ending")
    greeting.close()
    port.shut_down()
    say("ended")


if __name__ == "__main__":
    main()
