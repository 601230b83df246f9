"""The map of a site in memory, which follows what others write to the store."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from dataclasses import replace
from types import TracebackType
from weakref import WeakKeyDictionary

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer
from hypermap.fleet.store import pushing
from hypermap.fleet.store.address import Address, StoreAway, StoreError
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.followers import follow
from hypermap.fleet.store.sites import find_site, oldest_version
from hypermap.fleet.store.updates import Update, apply
from hypermap.history import begun
from hypermap.history.differences import differences

_REMEMBERED = 1000  # of our own versions
_PATIENCE = 1.0  # s between two tries to read what has changed

_log = logging.getLogger(__name__)


class FollowedSite:
    """The present map of a site; as a context, it listens to the store.

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
        self._versions: WeakKeyDictionary[Hypermap, int] = WeakKeyDictionary()
        self._own: deque[int] = deque(maxlen=_REMEMBERED)
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
        """The present map: the same object while nothing has changed."""
        return self._hypermap

    def write(self, seen: Hypermap, before: SemanticLayer, after: SemanticLayer) -> None:
        """Write a change of objects to the store, as one version of the site.

        New objects get their ids from the store.

        Args:
            seen: the map of this site that the change is made of.
            before: the layer before the change.
            after: the layer after it.

        Raises:
            Conflict: If another has changed or removed one of the objects since; then nothing is
                written.
            StoreError: If the store does not answer or refuses, or this is a former version.
        """
        if self._address.version is not None:
            raise StoreError(f"{self.address}: this is a former version, which does not change")
        changes = differences(before, after, "edit", time.time())
        if not changes:
            return
        old = [change.before.id or 0 for change in changes if change.before is not None]
        new = [
            item.with_id(change.before.id or 0) if change.before else replace(item, id=None)
            for change in changes
            if (item := change.after) is not None
        ]
        gone = [each.before.id or 0 for each in changes if each.before and each.after is None]
        versions = self._versions_of(before.name, old, self._versions.get(seen, 0))
        update = Update(self._site, before.name, new, gone, versions)
        try:
            written = apply(self._database, update)
        except StoreAway:  # it may be written: the same update is so only once
            written = apply(self._database, update)
        self._own.append(written.version)

    def _versions_of(self, layer: str, ids: list[int], since: int) -> dict[int, int]:
        """Return the versions of objects that only we have changed since; 0 for the others."""
        found = self._database.rows(
            "SELECT objects.id, valid_from FROM objects JOIN layers ON layers.id = layer_id "
            "JOIN sites ON sites.id = site_id WHERE sites.name = %s AND layers.name = %s "
            "AND valid_to IS NULL AND objects.id = ANY (%s) "
            "AND (valid_from <= %s OR valid_from = ANY (%s))",
            *(self._site, layer, ids, since, list(self._own)),
        )
        return dict.fromkeys(ids, 0) | dict(found)

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
            _log.warning("the map is unchanged for now: %s", error)
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
                is_thinned = self._version < oldest_version(database, site_id)
                if is_thinned or list(skeleton.frames) != list(before.frames):
                    before = Hypermap()  # what has changed is not known, or all lies elsewhere
                layers = [self._newest(layer, before, ids, version) for layer in skeleton]
                hypermap = skeleton.with_layers(layers)
                if hypermap.history is not None:
                    hypermap.history = begun(hypermap, hypermap.history)
        self._versions[hypermap] = version
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
