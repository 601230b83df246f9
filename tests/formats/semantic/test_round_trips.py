"""Any layer comes back exactly as it was, from each file that can hold one."""

from __future__ import annotations

from importlib.util import find_spec

from hypothesis import given

from hypermap.core.semantic import SemanticLayer
from hypermap.formats.semantic.geojson import from_geojson, to_geojson
from hypermap.formats.semantic.parquet_files import dump_parquet, parse_parquet
from hypermap.formats.semantic.yaml_files import PLUGIN
from hypermap.formats.store import MemoryStore

from ..strategies import layer_facts, semantic_layers


def of_yaml(layer: SemanticLayer) -> SemanticLayer:
    store = MemoryStore()
    PLUGIN.save(layer, store, "semantic")
    assert (len(layer) == 0) == (store.files == {})
    return PLUGIN.load(store, "semantic", layer.name, layer.frame_id, {}) if len(layer) else layer


def of_parquet(layer: SemanticLayer) -> SemanticLayer:
    content = dump_parquet(layer.table, layer.frame_id, layer.rejected)
    assert content == dump_parquet(layer.table, layer.frame_id, layer.rejected)
    table, rejected = parse_parquet(content, "t.hmap/semantic.parquet")
    return SemanticLayer.of_table(layer.name, layer.frame_id, table, None, rejected)


# One test for all, as to think of layers takes longer than to write and read them.
@given(semantic_layers(name="objects", frame_id="lab"))
def test_saving_and_loading_gives_exactly_the_same_objects(layer: SemanticLayer) -> None:
    facts = layer_facts(layer)
    assert layer_facts(of_yaml(layer)) == facts
    assert layer_facts(from_geojson(to_geojson(layer))) == facts
    if find_spec("pyarrow"):
        assert layer_facts(of_parquet(layer)) == facts
