# `make demo` and `make test` do all the set-up themselves, on a fresh machine too.

BIN := .venv/bin
PAGE := src/hypermap/viewer/page/app.js

.PHONY: demo test bench ros1 chromium lint types tests core-tests package platforms lowest format lock clean help

help:  ## list what can be made
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

demo: .venv/.hypermap  ## see a map being made: a simulated room, mapped and drawn
	$(BIN)/hypermap demo

test: ros1 chromium lint types tests core-tests package platforms  ## everything that CI checks

ros1:  ## install ROS 1 for its tests, where that is possible: on Debian 12, as root
	scripts/ros1.sh

chromium:  ## install the browser for the tests of the page, where that is possible
	scripts/chromium.sh

page: $(PAGE)  ## build the page that `hypermap view` opens

lint: .venv/.dev  ## style, and which room may import which
	scripts/page.sh check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: .venv/.dev  ## strict type check
	$(BIN)/mypy
	$(BIN)/mypy --strict examples/value_layer/src

tests: .venv/.dev $(PAGE)  ## all tests and the examples in the documents, with a coverage report
	$(BIN)/pytest -n auto --dist loadgroup --cov --cov-report=term --cov-report=xml

core-tests: .venv-core/.core  ## the core's tests with nothing but numpy and shapely installed
	.venv-core/bin/pytest -q tests/core src/hypermap/core

package: .venv/.dev $(PAGE)  ## build the wheel, and run the command from it
	scripts/check_wheel.sh

platforms: .venv/.dev  ## whether all requirements can be had on ARM, macOS and Windows
	scripts/check_platforms.sh

lowest: .venv/.dev  ## tests with the lowest versions that are promised: some minutes
	scripts/check_lowest.sh

bench: .venv/.bench  ## ours and its peers, measured side by side: 18 minutes
	scripts/peers.sh
	$(BIN)/hypermap bench --json benchmarks/races.json --markdown benchmarks/races.md \
	  --plots docs/images

format: .venv/.dev  ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock:  ## pin all requirements anew
	scripts/lock.sh

clean:  ## remove what was made
	rm -rf .venv .venv-core .venv-node build dist .coverage coverage.xml page/node_modules src/hypermap/viewer/page

$(PAGE): scripts/page.sh scripts/build_page.py page/build.mjs page/package-lock.json page/tsconfig.json $(wildcard page/src/* page/src/*/*)
	scripts/page.sh
	touch $@

.venv/.hypermap: requirements/hypermap.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/hypermap.txt
	touch $@

.venv/.dev: requirements/hypermap.txt requirements/dev.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/dev.txt
	touch .venv/.hypermap $@

.venv/.bench: requirements/hypermap.txt requirements/bench.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/bench.txt
	touch .venv/.hypermap $@

.venv-core/.core: requirements/core.txt scripts/venv.sh
	VENV=.venv-core scripts/venv.sh requirements/core.txt
	touch $@
