# `make setup`, `make run` and `make test` need nothing installed but Python 3.11 to 3.13, git and make.

SHELL := /bin/sh
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
PROTOCOL ?= protocols/elbow_flexion.yaml
# Two more than cores: some tests wait for a client library, a device or a browser.
PYTEST_WORKERS ?= 4
PYTEST_ARGS ?=
# An interpreter to prefer over what is found: make setup PYTHON=/path/to/python3.12
PYTHON ?=

# Settings of the user's shell that would make the environment's Python look outside of it.
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV PIP_USER PIP_TARGET PIP_PREFIX PIP_REQUIRE_VIRTUALENV
# The tests start hundreds of processes: without files of bytecode each would compile the package.
unexport PYTHONDONTWRITEBYTECODE

PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet

.PHONY: help setup run reproduce test check format bench long mutants pictures docs-numbers site lock clean

help: ## Show what can be made
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/\1\t\2/p' $(MAKEFILE_LIST) | while IFS="$$(printf '\t')" read -r name text; do \
		printf '  make %-12s %s\n' "$$name" "$$text"; \
	done

setup: $(VENV)/.project-installed ## Create .venv with the locked dependencies and this project

# The first interpreter that is new enough, not too new for the locked wheels, and able to create an environment.
$(VENV)/.lock-installed: requirements.lock
	@found=; seen=; \
	for python in $(PYTHON) python3 python3.13 python3.12 python3.11 python; do \
		version=$$("$$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) || continue; \
		seen="$$seen $$python is $$version;"; \
		case $$version in 3.11|3.12|3.13) ;; *) continue ;; esac; \
		"$$python" -c 'import ensurepip, venv' 2>/dev/null || { seen="$$seen but without venv (Debian: python3-venv);"; continue; }; \
		found=$$python; break; \
	done; \
	if [ -z "$$found" ]; then \
		echo "make setup: needs Python 3.11, 3.12 or 3.13 with venv; found:$${seen:- no Python at all;}" \
			"name one with: make setup PYTHON=/path/to/python3.12" >&2; \
		exit 1; \
	fi; \
	echo "Creating $(VENV) with $$found ($$version); this takes a minute or two and 2.5 GB."; \
	"$$found" -m venv --clear $(VENV)
	@$(PIP) --require-hashes -r requirements.lock
	@touch $@

$(VENV)/.project-installed: $(VENV)/.lock-installed pyproject.toml
	@$(PIP) --no-deps --no-build-isolation --no-index --editable .
	@find testbench -name '*.nb[ci]' -delete # kernels compiled by an earlier version
	@touch $@

run: setup ## Run a protocol on the simulated bench (PROTOCOL=protocols/elbow_flexion.yaml)
	$(BIN)/testbench run $(PROTOCOL)

reproduce: setup ## Run the published experiments on the simulated bench, their tables beside ours (reports in logs/)
	$(BIN)/testbench study --reproduce

# A file stays on one worker, for its tests share what takes long to make; the slow files come first.
test: setup ## Run all tests (PYTEST_ARGS="-k name", PYTEST_WORKERS=4)
	$(BIN)/python -m pytest -q -n $(PYTEST_WORKERS) --dist loadfile --no-loadscope-reorder $(PYTEST_ARGS)

check: setup ## Check format, lint, types and the direction of imports
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup ## Format the code and apply the linter's safe fixes
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

bench: setup ## Time the hot paths; fails where a bar of speed or size is missed
	$(BIN)/python -m tests.benchmarks

long: setup ## Ask by the hundred what the tests ask a few times; stopped, it goes on where it was
	$(BIN)/python -m tests.benchmarks.long

mutants: setup ## Put hundreds of plausible wrong numbers into copies of the program, and see which tests notice; goes on where it was
	$(BIN)/python -m tests.benchmarks.mutants

pictures: setup ## Make every picture of the docs anew (Chromium, and a Vulkan driver for the viewer)
	$(BIN)/python -m tests.documents.pictures

docs-numbers: setup ## Compute the tables of the docs anew, where a comment above them names what makes them
	$(BIN)/python -m tests.documents.numbers

site: setup ## Build the docs as a site into build/site
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

lock: setup ## Pin the newest allowed versions in requirements.lock
	@printf '%s\n' \
		'# Every dependency of the bench, its tests and its build, pinned with the sha256 of every file of its release.' \
		'# Written by `make lock`: do not edit. `make setup` installs it. For CPython 3.11, 3.12 and 3.13 on Linux x86_64' \
		'# and macOS arm64; on Linux aarch64 ruckig and vqf are built from source, which needs a C++ compiler.' \
		> requirements.lock.new
	$(BIN)/uv pip compile pyproject.toml --all-extras --universal --python-version 3.11 --fork-strategy fewest --upgrade \
		--generate-hashes --no-emit-index-url --no-emit-find-links --no-header --quiet >> requirements.lock.new
	mv requirements.lock.new requirements.lock

clean: ## Remove the environment, caches and builds; sessions in logs/ stay
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find testbench tests examples -name __pycache__ -type d -prune -exec rm -rf {} +
