"""The first tables: sites, their versions, and what each version holds.

What may change between versions has `valid_from`, the version that brought it, and `valid_to`, the
version that replaced it; NULL for what is there now. Tables of many rows have no foreign keys,
whose checks take half the time of a push; rows of `sites` and `layers`, to which they refer, are
never deleted.
"""

from alembic import op

revision = "1"
down_revision = None

SRID = 990001  # a local engineering system: meters on the floor of one site

TABLES = f"""
CREATE TABLE hypermap.sites (
    id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    name text NOT NULL UNIQUE CHECK (name <> ''),
    version integer NOT NULL,
    created timestamptz NOT NULL DEFAULT now()
);
CREATE TABLE hypermap.writers (
    site_id integer NOT NULL REFERENCES hypermap.sites,
    role name NOT NULL,
    PRIMARY KEY (site_id, role)
);
CREATE TABLE hypermap.versions (
    site_id integer NOT NULL REFERENCES hypermap.sites,
    version integer NOT NULL,
    at timestamptz NOT NULL DEFAULT clock_timestamp(),
    author text NOT NULL DEFAULT session_user,
    note text NOT NULL,
    update_id uuid NOT NULL UNIQUE,
    outcome jsonb NOT NULL,
    PRIMARY KEY (site_id, version)
);
CREATE TABLE hypermap.layers (
    id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    site_id integer NOT NULL REFERENCES hypermap.sites,
    name text NOT NULL,
    kind text NOT NULL,
    frame_id text NOT NULL,
    next_id integer NOT NULL DEFAULT 0,
    next_position bigint NOT NULL DEFAULT 0,
    UNIQUE (site_id, name)
);
CREATE TABLE hypermap.tracks (
    layer_id integer NOT NULL,
    source text NOT NULL,
    local_id integer NOT NULL,
    object_id integer NOT NULL,
    written integer NOT NULL,
    existence float8,
    first_seen float8,
    last_seen float8,
    PRIMARY KEY (layer_id, source, local_id)
);
CREATE INDEX tracks_object ON hypermap.tracks (layer_id, object_id);
CREATE TABLE hypermap.files (
    site_id integer NOT NULL,
    name text NOT NULL,
    content bytea NOT NULL,
    valid_from integer NOT NULL,
    valid_to integer
);
CREATE TABLE hypermap.grids (
    layer_id integer NOT NULL,
    width integer NOT NULL,
    height integer NOT NULL,
    resolution float8 NOT NULL,
    x float8 NOT NULL,
    y float8 NOT NULL,
    yaw float8 NOT NULL,
    kind text NOT NULL,
    valid_from integer NOT NULL,
    valid_to integer
);
CREATE TABLE hypermap.tiles (
    layer_id integer NOT NULL,
    tile_row integer NOT NULL,
    tile_col integer NOT NULL,
    cells bytea NOT NULL,
    valid_from integer NOT NULL,
    valid_to integer
);
CREATE TABLE hypermap.objects (
    layer_id integer NOT NULL,
    id integer NOT NULL,
    position bigint NOT NULL,
    name text NOT NULL,
    shape geometry(Geometry, {SRID}) NOT NULL,
    footprint bytea,
    area float8 NOT NULL,
    x float8 NOT NULL,
    y float8 NOT NULL,
    tags text[],
    confidence float8[],
    existence float8,
    first_seen float8,
    last_seen float8,
    attributes text,
    valid_from integer NOT NULL,
    valid_to integer
);
CREATE TABLE hypermap.views (
    layer_id integer NOT NULL,
    number integer NOT NULL,
    stamp float8 NOT NULL,
    pose bytea NOT NULL,
    area bytea NOT NULL,
    valid_from integer NOT NULL,
    valid_to integer
);
CREATE TABLE hypermap.observations (
    layer_id integer NOT NULL,
    number integer NOT NULL,
    object_id integer NOT NULL,
    view integer NOT NULL,
    score float8 NOT NULL,
    lowest float8 NOT NULL,
    highest float8 NOT NULL,
    footprint bytea NOT NULL,
    valid_from integer NOT NULL,
    valid_to integer
);
CREATE TABLE hypermap.pictures (
    layer_id integer NOT NULL,
    object_id integer NOT NULL,
    content bytea NOT NULL,
    valid_from integer NOT NULL,
    valid_to integer
);
"""

# For each table of versions: its owner, and the rest of its key.
KEYS = {
    "files": ("site_id", "name"),
    "grids": ("layer_id",),
    "tiles": ("layer_id", "tile_row", "tile_col"),
    "objects": ("layer_id", "id"),
    "views": ("layer_id", "number"),
    "observations": ("layer_id", "number"),
    "pictures": ("layer_id", "object_id"),
}

INDEXES = """
CREATE INDEX objects_shape ON hypermap.objects USING gist (layer_id, shape) WHERE valid_to IS NULL;
CREATE INDEX objects_name ON hypermap.objects (name, layer_id) WHERE valid_to IS NULL;
CREATE INDEX observations_object ON hypermap.observations (layer_id, object_id)
    WHERE valid_to IS NULL;
"""

SYSTEM = f"""
INSERT INTO public.spatial_ref_sys (srid, auth_name, auth_srid, srtext, proj4text) VALUES (
    {SRID}, 'hypermap', {SRID},
    'LOCAL_CS["The floor of one site",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]', ''
) ON CONFLICT (srid) DO NOTHING;
"""

# Roles belong to the server, and may be there for another store.
ROLES = """
DO $$
DECLARE
    wanted text;
BEGIN
    FOREACH wanted IN ARRAY ARRAY['hypermap_reader', 'hypermap_robot', 'hypermap_editor'] LOOP
        IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = wanted) THEN
            EXECUTE format('CREATE ROLE %I NOLOGIN', wanted);
        END IF;
    END LOOP;
END $$;
GRANT hypermap_reader TO hypermap_robot, hypermap_editor;
GRANT USAGE ON SCHEMA hypermap TO hypermap_reader;
GRANT SELECT ON ALL TABLES IN SCHEMA hypermap TO hypermap_reader;
GRANT SELECT ON public.spatial_ref_sys TO hypermap_reader;
GRANT INSERT, UPDATE ON hypermap.versions, hypermap.layers, hypermap.files, hypermap.grids,
    hypermap.tiles, hypermap.objects, hypermap.views, hypermap.observations, hypermap.pictures
    TO hypermap_robot, hypermap_editor;
GRANT INSERT, UPDATE, DELETE ON hypermap.tracks TO hypermap_robot, hypermap_editor;
GRANT UPDATE ON hypermap.sites TO hypermap_robot;
GRANT INSERT, UPDATE ON hypermap.sites TO hypermap_editor;
GRANT INSERT, UPDATE, DELETE ON hypermap.writers TO hypermap_editor;

CREATE FUNCTION hypermap.own_sites() RETURNS integer[] LANGUAGE sql STABLE AS $$
    SELECT coalesce(array_agg(site_id), '{}') FROM hypermap.writers
    WHERE role IN (SELECT rolname FROM pg_roles WHERE pg_has_role(oid, 'MEMBER'))
$$;
CREATE FUNCTION hypermap.own_layers() RETURNS integer[] LANGUAGE sql STABLE AS $$
    SELECT coalesce(array_agg(id), '{}') FROM hypermap.layers
    WHERE site_id = ANY (hypermap.own_sites())
$$;
"""


def upgrade() -> None:
    """Create all tables, their indexes, and the roles and what these may do."""
    op.execute(TABLES)
    for table, key in KEYS.items():
        op.execute(
            f"CREATE UNIQUE INDEX {table}_now ON hypermap.{table} ({', '.join(key)}) "
            f"WHERE valid_to IS NULL"
        )
        op.execute(
            f"CREATE INDEX {table}_before ON hypermap.{table} ({key[0]}, valid_to) "
            f"WHERE valid_to IS NOT NULL"
        )
    op.execute(INDEXES)
    op.execute(SYSTEM)
    op.execute(ROLES)
    for table in ("sites", "versions", "layers", "tracks", *KEYS):
        _protect(table)


def _protect(table: str) -> None:
    """Let all read a table, editors write it, and robots what belongs to their own sites."""
    owner = {"sites": "id", "versions": "site_id", "layers": "site_id", "files": "site_id"}
    column = owner.get(table, "layer_id")
    what = "layers" if column == "layer_id" else "sites"
    own = f"{column} = ANY ((SELECT hypermap.own_{what}())::integer[])"
    op.execute(f"ALTER TABLE hypermap.{table} ENABLE ROW LEVEL SECURITY")
    op.execute(
        f"CREATE POLICY readers ON hypermap.{table} FOR SELECT TO hypermap_reader USING (true)"
    )
    op.execute(
        f"CREATE POLICY editors ON hypermap.{table} TO hypermap_editor USING (true) "
        "WITH CHECK (true)"
    )
    op.execute(
        f"CREATE POLICY robots ON hypermap.{table} TO hypermap_robot USING ({own}) "
        f"WITH CHECK ({own})"
    )
