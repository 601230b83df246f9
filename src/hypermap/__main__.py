"""Run the command line as `python -m hypermap`."""

from hypermap.cli.start import main

main()
