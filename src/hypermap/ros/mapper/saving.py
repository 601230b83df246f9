"""When a live node saves its map: periodically, at the end, and on request."""

from __future__ import annotations

import threading
from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.core.history import MAP_VERSION
from hypermap.formats import open_map, save_map
from hypermap.formats.backup import or_elsewhere, save_with_backup
from hypermap.formats.locks import turn_to_edit
from hypermap.mapping.going_on import layer_of_objects
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.port import Level, Port
from hypermap.ros.server.map_directory import archive_within
from hypermap.ros.server.save_at_end import free_name
from hypermap.ros.throttle import Throttle
from hypermap.text import counted


class Saving:
    """Saves a live map, so that a node that is killed has lost little.

    What lay in a file before the node saved there for the first time stays next to it, as NAME.bak,
    also if the node is deactivated and activated in between. Mapping goes on with what people edit
    in the file meanwhile. Where another program puts another map in its place, that one stays, and
    this map is saved beside it from then on, also once the node is activated again.
    """

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, log: Throttle
    ) -> None:
        """Begin to save by itself, if `save_to` says where; and say so."""
        self._port = port
        self._map = live_map
        self._log = log
        self._path: Path | None = None
        if settings.save_to:
            self._path = live_map.files.in_place_of(Path(settings.save_to).absolute())
        self._directory = settings.map_directory
        self._every = settings.save_every
        self._saved_state = live_map.state
        self._saved = ""  # what was saved there last, for the log
        self._lock = threading.Lock()
        self._ends = threading.Event()
        # The wall's clock: that of a simulator or a bag may stand still.
        self._thread: threading.Thread | None = None
        if self._path is None:
            level: Level = "warning" if settings.onto else "info"  # who goes on also wants to save
            said = "no save_to (-o) says where: the map is saved only when save_map is called"
            port.log(level, said)
            return
        often = f"every {self._every:g} s and " if self._every else ""
        port.log("info", f"the map is saved in {self._path}, {often}at the end")
        if self._every:
            self._thread = threading.Thread(target=self._work, name="saving", daemon=True)
            self._thread.start()

    def store(self, filename: str) -> None:
        """Save the map in a file that a client names; without a name, where it is saved anyway.

        It lies in `map_directory`; without one, it is a new file next to `save_to`, or in the
        folder in which the node was started.

        Raises:
            HypermapError: If the name leads elsewhere or to another's file, or it cannot be saved.
        """
        if not filename and self._path is not None:
            self._save(self._path)
            return
        default = Path.cwd() if self._path is None else self._path.parent
        path = archive_within(Path(self._directory or default).absolute(), filename)
        is_own = path == self._path or path in self._map.files
        if not self._directory and path.exists() and not is_own:
            raise HypermapError(
                f"{path} exists already: choose another name, or set map_directory, the folder "
                "in which maps may be replaced"
            )
        self._save(path)

    def close(self) -> None:
        """End, and save what is new.

        Raises:
            HypermapError: If it cannot be saved; then it is in the folder for temporary files.
        """
        self._ends.set()
        if self._thread is not None:
            self._thread.join()
        if self._path is None:
            return
        if not self._map.is_new:
            known = counted(self._map.repeated, "frame")
            why = f": the map that is continued has {known} already" if self._map.repeated else ""
            self._port.log("warning", f"nothing was mapped, so nothing is saved{why}")
        elif self._map.state != self._saved_state:
            with or_elsewhere(self._path.name, self._map.hypermap):
                self._save(self._path)
        else:
            self._port.log("info", f"all is saved in {self._path}{self._saved}")

    def _work(self) -> None:
        assert self._path is not None
        while not self._ends.wait(self._every):
            if not self._map.is_new or self._map.state == self._saved_state:
                continue
            try:
                self._save(self._path, "debug" if self._path in self._map.files else "info")
            except Exception as error:  # perhaps the disk has room again the next time
                self._log.log("error", "saving", f"the map is not saved: {error}; trying again")

    def _save(self, path: Path, level: Level = "info") -> None:
        with self._lock:  # an older map must not replace a newer one
            self._save_in_turn(self._map.files.in_place_of(path), level)

    def _save_in_turn(self, path: Path, level: Level) -> None:
        with turn_to_edit(path):
            if self._map.files.is_changed(path):
                path = self._after_others(path)
            state = self._map.state
            hypermap = self._map.hypermap()
            hypermap.metadata[MAP_VERSION] += self._map.saves
            self._map.saves += 1
            if path in self._map.files:
                save_map(hypermap, path)
            elif backup := save_with_backup(hypermap, path, spare_edited=True):
                self._port.log("warning", f"{path} was there before; it stays as {backup}")
            self._map.files.add(path, hypermap)
            if path == self._path:
                self._saved_state = state
        layer = layer_of_objects(hypermap)
        objects = counted(0 if layer is None else len(layer), "object")
        if path == self._path:
            self._saved = f": {objects}"
        self._port.log(level, f"saved {objects} to {path}")

    def _after_others(self, path: Path) -> Path:
        """Take over what others have edited in a file, or else return another to save in."""
        try:
            edited = open_map(path)
            if self._map.files.is_copy(edited):
                self._map.take_edits(edited)
                self._port.log("info", f"{path} was edited; mapping goes on with the edits")
                return path
        except HypermapError as error:
            self._log.log("debug", "edited", f"{path} was replaced: {error}")
        beside = free_name(path)
        self._port.log(
            "error",
            f"another program has replaced {path}, which stays as it is; this map is saved in "
            f"{beside} from now on",
        )
        self._map.files.leave(path, beside)
        if path == self._path:
            self._path = beside
        return beside
