"""The service that answers questions in English; see hypermap_msgs/srv/Ask.srv."""

from __future__ import annotations

import json

from hypermap.console.asked import lines
from hypermap.questions.asking import answer_to
from hypermap.ros.messages.to_messages import object_states
from hypermap.ros.port import Message, Port
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.requests import Requests


class Ask:
    """Answers questions in English, or queries as JSON, in the base frame."""

    def __init__(self, port: Port, current: CurrentMap, requests: Requests) -> None:
        self._port = port
        self._current = current
        self._requests = requests

    def answer(self, request: Message) -> Message:
        """Answer `hypermap_msgs/Ask`; raises HypermapError if the question cannot be read."""
        hypermap = self._current.hypermap
        asker = None
        if request.pose.header.frame_id:
            turn = request.pose.pose.orientation
            if (turn.x, turn.y, turn.z, turn.w) == (0, 0, 0, 0):
                turn.w = 1.0  # left out: straight ahead
            asker = self._requests.pose(hypermap, request.pose)
        answer = answer_to(hypermap, str(request.question), asker)
        found = answer.objects
        distances = [float(item.distance) for item in found if item.distance is not None]
        return self._port.response("hypermap_msgs/Ask")(
            success=True,
            message="",
            frame_id=hypermap.base_frame,
            query=json.dumps(answer.query.to_json()),
            answer="\n".join(lines(hypermap, answer)),
            count=answer.count,
            objects=object_states(list(found), self._port),
            distances=distances if len(distances) == len(found) else [],
        )
