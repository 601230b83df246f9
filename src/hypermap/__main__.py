"""Run the command line as `python -m hypermap`."""

from hypermap.cli.main import main

main()
