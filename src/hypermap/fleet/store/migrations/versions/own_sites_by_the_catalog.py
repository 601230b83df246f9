"""Who may write a site: looked up in the catalog alone.

The functions named `pg_roles` without its schema, so a robot could put a temporary table of that
name in its place, and write the sites of others.
"""

from alembic import op

revision = "2"
down_revision = "1"

FUNCTIONS = """
CREATE OR REPLACE FUNCTION hypermap.own_sites() RETURNS integer[] LANGUAGE sql STABLE
SET search_path = pg_catalog, pg_temp AS $$
    SELECT coalesce(array_agg(site_id), '{}') FROM hypermap.writers
    WHERE role IN (SELECT rolname FROM pg_catalog.pg_roles WHERE pg_has_role(oid, 'MEMBER'))
$$;
CREATE OR REPLACE FUNCTION hypermap.own_layers() RETURNS integer[] LANGUAGE sql STABLE
SET search_path = pg_catalog, pg_temp AS $$
    SELECT coalesce(array_agg(id), '{}') FROM hypermap.layers
    WHERE site_id = ANY (hypermap.own_sites())
$$;
"""


def upgrade() -> None:
    """Replace both functions; the policies that call them stay."""
    op.execute(FUNCTIONS)
