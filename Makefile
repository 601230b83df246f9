# `make demo` and `make test` do all the set-up themselves, on a fresh machine too.

# Another Python gets an environment of its own: make test PYTHON=python3.12
VERSION := $(if $(PYTHON),$(shell $(PYTHON) -c 'import sys; print("-%d.%d" % sys.version_info[:2])'))
ifeq ($(if $(PYTHON),$(VERSION),-),)
$(error PYTHON=$(PYTHON) does not run; name a Python 3.10 or newer)
endif
export VENV := .venv$(VERSION)
BIN := $(VENV)/bin
# Should the tests as a whole hang: they end after so many seconds (none: make test LIMIT=0).
LIMIT := 3600
# How long the campaign may take, all parts together.
MINUTES := 60
ENDING := $(if $(shell command -v timeout),timeout --foreground --kill-after=60 $(LIMIT))
# Two more than there are cores, as some tests wait for other programs.
WORKERS := $(shell expr $$(getconf _NPROCESSORS_ONLN) + 2)
PAGE := src/hypermap/viewer/page/app.js

.PHONY: demo test bench campaign docs ros1 postgres chromium pictures lint types tests coverage core-tests package platforms lowest newest sbom audit format lock clean help

help:  ## list what can be made
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

demo: $(VENV)/.hypermap  ## see a map being made: a simulated room, mapped and drawn
	$(BIN)/hypermap demo

test: ros1 postgres chromium lint types tests core-tests package platforms  ## everything that CI checks

ros1:  ## install ROS 1 for its tests, where that is possible: on Debian 12, as root
	scripts/ros1.sh

postgres:  ## install PostgreSQL with PostGIS for its tests, where that is possible: on Debian 12, as root
	scripts/postgres.sh

pictures: .venv/.dev $(PAGE)  ## take the pictures of the page, a run and rviz that the documents show
	$(BIN)/python scripts/pictures.py

chromium:  ## install the browser for the tests of the page, where that is possible
	scripts/chromium.sh

page: $(PAGE)  ## build the page that `hypermap view` opens

lint: $(VENV)/.dev  ## style, and which room may import which
	scripts/page.sh check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(VENV)/.dev  ## strict type check, with Python 3.11
	scripts/types.sh

tests: $(VENV)/.dev $(PAGE)  ## all tests and the examples in the documents
	# First what each worker would compile: loops and tests. At last the slowest tests are named.
	PYTHONDONTWRITEBYTECODE= $(BIN)/pytest -n0 -q --collect-only >/dev/null & $(BIN)/hypermap warm-up && wait
	$(ENDING) $(BIN)/pytest -n $(WORKERS) --dist loadgroup --durations=10

coverage: $(VENV)/.dev $(PAGE)  ## all tests, and which lines they reach: takes half as long again
	$(BIN)/pytest -n $(WORKERS) --dist loadgroup --cov --cov-report=term --cov-report=xml

core-tests: .venv-core$(VERSION)/.core  ## the core's tests with nothing but numpy and shapely installed
	.venv-core$(VERSION)/bin/pytest -q tests/core src/hypermap/core

package: $(VENV)/.dev $(PAGE)  ## build the wheel, and run the command from it
	scripts/check_wheel.sh

platforms: $(VENV)/.dev  ## whether all requirements can be had on ARM, macOS and Windows
	scripts/check_platforms.sh

lowest: $(VENV)/.dev  ## tests with the lowest versions that are promised: some minutes
	scripts/check_versions.sh lowest

newest: $(VENV)/.dev  ## tests with the newest versions that pip finds: some minutes
	scripts/check_versions.sh newest

sbom: $(VENV)/.dev  ## what an install brings, as CycloneDX: dist/hypermap.cdx.json
	mkdir -p dist
	$(BIN)/python scripts/sbom.py requirements/hypermap.txt dist/hypermap.cdx.json

audit: .venv-audit$(VERSION)/.audit  ## whether packages that an install brings have known vulnerabilities
	.venv-audit$(VERSION)/bin/python scripts/audit.py requirements/hypermap.txt

docs: $(VENV)/.docs  ## build the documentation as a site, build/site/index.html: every link checked, notebooks run
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build

bench: $(VENV)/.bench  ## ours and its peers, measured side by side: 18 minutes
	scripts/peers.sh
	$(BIN)/hypermap bench --times benchmarks/races.json --markdown benchmarks/races.md \
	  --plots docs/images

campaign: $(VENV)/.dev $(PAGE)  ## faults, hostile input and long runs: an hour (MINUTES=10), PARTS="kill fuzz"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements/campaign.txt || \
	  echo "without atheris, fuzzing draws its input at random"
	$(BIN)/python -m campaign $(PARTS) --minutes $(MINUTES)

format: $(VENV)/.dev  ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock:  ## pin all requirements again
	scripts/lock.sh

clean:  ## remove what was made
	rm -rf .venv .venv-* build dist .coverage coverage.xml page/node_modules src/hypermap/viewer/page

$(PAGE): scripts/page.sh scripts/build_page.py page/build.mjs page/package-lock.json page/tsconfig.json $(wildcard page/src/* page/src/*/*)
	scripts/page.sh
	touch $@

$(VENV)/.hypermap: requirements/hypermap.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/hypermap.txt
	touch $@

$(VENV)/.dev: requirements/hypermap.txt requirements/dev.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/dev.txt
	touch $(VENV)/.hypermap $@

$(VENV)/.docs: requirements/hypermap.txt requirements/docs.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/docs.txt
	touch $(VENV)/.hypermap $@

$(VENV)/.bench: requirements/hypermap.txt requirements/bench.txt pyproject.toml scripts/venv.sh
	scripts/venv.sh requirements/bench.txt
	touch $(VENV)/.hypermap $@

.venv-core$(VERSION)/.core: requirements/core.txt scripts/venv.sh
	VENV=.venv-core$(VERSION) scripts/venv.sh requirements/core.txt
	touch $@

.venv-audit$(VERSION)/.audit: requirements/audit.txt scripts/venv.sh
	VENV=.venv-audit$(VERSION) scripts/venv.sh requirements/audit.txt
	touch $@
