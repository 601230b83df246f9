"""The map of a site in memory, which follows what others write to the store."""

from __future__ import annotations

import logging
import threading
from types import TracebackType

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.fleet.store import pushing
from hypermap.fleet.store.address import Address, StoreAway
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.followers import follow
from hypermap.fleet.store.sites import find_site
from hypermap.history import begun

_PATIENCE = 1.0  # s between two tries to read what has changed

_log = logging.getLogger(__name__)


class FollowedSite:
    """The map of a site as it is now; as a context, it listens to the store.

    Each version is a map of its own, which never changes; layers in which nothing has changed are
    those of the version before. While the database is away, the map stays as it was.

    Args:
        address: of a site. With a version, the map is that one for good.

    Raises:
        StoreError: If the store refuses, does not answer, or has no such site or version.
    """

    def __init__(self, address: Address) -> None:
        assert address.site is not None  # or `site_address` has refused it
        self._address = address
        self._site = address.site
        self._database = Database(address)
        self._hypermap, self._version = Hypermap(), 0
        self._take_over()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="store", daemon=True)

    @property
    def name(self) -> str:
        """The name of the site."""
        return self._site

    @property
    def address(self) -> str:
        """The address, without a password."""
        return self._address.shown

    @property
    def hypermap(self) -> Hypermap:
        """The map as it is now: the same object while nothing has changed."""
        return self._hypermap

    def __enter__(self) -> FollowedSite:
        if self._address.version is None:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._database.close()

    def _listen(self) -> None:
        try:
            for version in follow(self._address, self._ended):
                while version > self._version and not self._ended.is_set():
                    self._try_to_take_over()
        except HypermapError as error:
            _log.error("the map is no longer followed: %s", error)

    def _try_to_take_over(self) -> None:
        try:
            self._take_over()
        except StoreAway as error:
            _log.warning("the map stays as it is for now: %s", error)
            self._ended.wait(_PATIENCE)

    def _take_over(self) -> None:
        """Read what has changed since the version that is known."""
        database, before = self._database, self._hypermap
        with database.snapshot():
            site_id, newest = find_site(database, self._site)
            version = newest if self._address.version is None else self._address.version
            if self._version == 0:
                hypermap = pushing.pull(database, self._site, version)
            else:
                skeleton = pushing.skeleton_of(database, site_id, version, self._site)
                ids = pushing.ids_of_layers(database, site_id)
                if list(skeleton.frames) != list(before.frames):
                    before = Hypermap()  # all lies elsewhere
                layers = [self._newest(layer, before, ids, version) for layer in skeleton]
                hypermap = skeleton.with_layers(layers)
                if hypermap.history is not None:
                    hypermap.history = begun(hypermap, hypermap.history)
        self._hypermap, self._version = hypermap, version

    def _newest(self, layer: Layer, before: Hypermap, ids: dict[str, int], version: int) -> Layer:
        """Return a layer of a skeleton with its content; the one before, if that is the same."""
        number = ids.get(layer.name)
        if number is None:
            return layer
        if layer.name in before and not pushing.has_changed(self._database, number, self._version):
            known = before[layer.name]
            if (known.frame_id, known.settings) == (layer.frame_id, layer.settings):
                return known
        return pushing.read_layer(self._database, layer, number, version)
