"""What Alembic runs: the steps, in the connection that `migrating` has made."""

from alembic import context

from hypermap.fleet.store.migrating import VERSION_TABLE

context.configure(
    connection=context.config.attributes["connection"],
    version_table=VERSION_TABLE,
    version_table_schema="hypermap",
)
with context.begin_transaction():
    context.run_migrations()
