# Needs python3 (3.11 or newer), cargo, a C compiler and make. Everything else goes into .venv.
#   make setup   the environment and the extension        make test    all checks but the long ones
#   make demo    the first result, out/demo/report.html   make check   a changed line of physics, in a minute
#   make help    the other targets                        CONTRIBUTING.md: how to add what

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMPS := .stamps

# Modules compiled once are imported faster ever after, also where the environment forbids writing.
unexport PYTHONDONTWRITEBYTECODE
# Another environment that happens to be active must not be taken for ours.
unexport VIRTUAL_ENV
unexport CONDA_PREFIX

# The build for work on physics: one batch type, compiled in seconds. Its extension stands in a
# folder of its own, where only `make check` looks; the package beside it is links into this tree.
PHYSICS := --locked --quiet --profile physics --features physics
OVERLAY := $(CURDIR)/$(STAMPS)/physics
CHECK   ?= tests/physics

RUST_SOURCES := Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)
# The binary of FMUs, from the core that the extension has compiled: a link and the interface itself.
CAPI := $(BIN)/python tools/capi.py

DEMO := $(BIN)/elevon demo --out out/demo --force

.DELETE_ON_ERROR:
.PHONY: help setup beginnings capi demo check test test-rust test-python test-long lint size stubs docs wheel sdist bench format lock audit licences clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

setup: $(STAMPS)/extension $(STAMPS)/cases ## make .venv, install the locked packages, build the extension, add the published cases

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "elevon needs Python 3.11 or newer; try make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(STAMPS)/packages: requirements.lock | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@mkdir -p $(STAMPS) && touch $@

# The core needs no package, and compiles while they install.
$(STAMPS)/core: $(RUST_SOURCES)
	cargo build --release --locked --quiet --package elevon-core
	@mkdir -p $(STAMPS) && touch $@

beginnings: $(STAMPS)/core $(STAMPS)/packages
	@:

$(STAMPS)/extension: requirements.lock pyproject.toml $(RUST_SOURCES)
	@$(MAKE) --no-print-directory --jobs=2 beginnings
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --quiet --locked
	$(CAPI)
	@touch $@

# The published cases, as they lie in cases/; their build tool is one of the locked packages.
$(STAMPS)/cases: cases/pyproject.toml $(STAMPS)/extension
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-index \
		--no-build-isolation --editable ./cases
	@touch $@

capi: $(STAMPS)/packages ## the C interface: target/release/libelevon.a and .so, the header, the binary of FMUs
	$(CAPI)
	@if command -v cbindgen >/dev/null; then \
		cbindgen --quiet --config crates/elevon-capi/cbindgen.toml crates/elevon-capi/src/c.rs \
			--output crates/elevon-capi/include/elevon.h; fi

demo: setup ## a unit's life, its diagnoses, its predicted end: out/demo/report.html
	$(DEMO)

test: setup lint test-rust test-python ## every check but the long ones

test-rust: ## the closed forms of the components, beside them
	cargo test $(PHYSICS) --package elevon-core --lib

check: $(STAMPS)/packages test-rust ## from a saved line of physics to its tests; CHECK=tests/physics/test_backlash.py for less
	cargo build $(PHYSICS) --package elevon-py --lib
	@rm -rf $(OVERLAY) && mkdir -p $(OVERLAY)/elevon
	@ln -s $(CURDIR)/python/elevon/* $(OVERLAY)/elevon/ && rm -f $(OVERLAY)/elevon/_core*.so
	@cp target/physics/lib_core.$(if $(filter Darwin,$(shell uname)),dylib,so) $(OVERLAY)/elevon/_core.abi3.so
	PYTHONPATH=$(OVERLAY) $(BIN)/python -m pytest -q -n 2 -m "not long and not bench" $(CHECK)

test-python: setup
	$(BIN)/python -m pytest -q -n 2 --dist worksteal -m "not long and not bench"

test-long: setup ## the checks that take minutes
	$(BIN)/python -m pytest -q -n 2 -m "long and not bench"

lint: setup stubs ## formatting, style and types of both languages
	$(BIN)/python tools/words.py
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	cargo fmt --all --check
	cargo clippy --locked --release --workspace --all-targets --quiet -- -D warnings

size: $(STAMPS)/packages ## lines of Python code wherever it stands, modules, classes, share of imports, signatures with Any
	$(BIN)/python tools/size.py

stubs: $(STAMPS)/extension ## the hand-written stub against the built extension
	cd $(STAMPS) && ../$(BIN)/python -m mypy.stubtest elevon._core

$(STAMPS)/docs: requirements-docs.lock $(STAMPS)/packages
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-docs.lock
	@touch $@

docs: setup $(STAMPS)/docs ## the documentation site, its links followed: out/docs/index.html
	$(BIN)/python tools/pages/build.py

wheel: $(STAMPS)/packages ## the wheels of product and cases in dist/, checked where there is no compiler
	$(CAPI)
	git rev-parse --short=12 HEAD > python/elevon/cli/commit.txt
	$(BIN)/maturin build --release --quiet --locked --out dist
	@rm -f python/elevon/cli/commit.txt
	$(BIN)/python -m pip wheel --quiet --no-deps --no-index --no-build-isolation --wheel-dir dist ./cases
	$(BIN)/python tools/check_wheel.py dist

sdist: $(STAMPS)/packages ## the source distribution in dist/, built once more from itself
	git rev-parse --short=12 HEAD > python/elevon/cli/commit.txt
	$(BIN)/maturin sdist --out dist
	@rm -f python/elevon/cli/commit.txt
	@rm -rf dist/from-source
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist/from-source dist/elevon-*.tar.gz
	$(BIN)/python tools/check_wheel.py dist/from-source --from-sdist

bench: setup ## the timed comparisons
	$(BIN)/python -m pytest -q -m bench

format: setup ## rewrite the sources in the project's format
	$(BIN)/ruff format
	$(BIN)/ruff check --fix
	cargo fmt --all

lock: $(BIN)/python ## choose the newest packages again, for Python 3.11 and up
	$(BIN)/uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 \
		--no-emit-index-url --no-emit-find-links --upgrade --quiet --generate-hashes \
		--custom-compile-command "make lock" --output-file requirements.lock
	$(BIN)/uv pip compile pyproject.toml --extra docs --universal --python-version 3.11 --constraint requirements.lock \
		--no-emit-index-url --no-emit-find-links --quiet --generate-hashes \
		--custom-compile-command "make lock" --output-file requirements-docs.lock

audit: $(STAMPS)/packages ## known flaws of the dependencies of both languages; needs a network and cargo-deny, pip-audit
	@command -v cargo-deny >/dev/null || { echo "make audit needs cargo-deny: cargo install --locked cargo-deny" >&2; exit 1; }
	@command -v pip-audit >/dev/null || { echo "make audit needs pip-audit: pipx install pip-audit" >&2; exit 1; }
	cargo deny --locked check
	pip-audit --require-hashes --disable-pip --requirement requirements.lock
	$(BIN)/python tools/licences.py

licences: $(STAMPS)/packages ## the licence of every dependency; refused where none of the allowed ones
	$(BIN)/python tools/licences.py

clean: ## remove what was built; .venv stays
	rm -rf $(STAMPS) out target .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
	find python -name '_core*.so' -delete
