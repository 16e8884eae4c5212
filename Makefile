# `make run` and `make test` work from a bare clone with Python 3.11, make and git.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
READY := .venv/.ready
# mypy and import-linter find modules by their folders: they read a copy that is laid out as the wheel. A strict
# editable install would not do: it consists of links, and lacks new files until the next install
COPY := build/copy
# two workers: the tests of a scene run on one of them, and both share what was played
PYTEST := $(BIN)/python -m pytest -n 2

# cached bytecode: dozens of processes import the same modules
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test test-engines test-all test-commands check docs release clean

run: $(READY)
	$(BIN)/touchstone run $(ARGS)

# all but the slow tests; the budget is in seconds of processor time
test: $(READY)
	$(PYTEST) --cpu-budget 1200 --hypothesis-profile repeatable $(ARGS)

# what plays DART, Bullet and MuJoCo, slow tests too
test-engines: $(READY)
	$(PYTEST) -m engines $(ARGS)

test-all: $(READY)
	$(PYTEST) -m "slow or not slow" $(ARGS)

# every command of README and docs as written, for an hour or two: the exit codes are those of the page
test-commands: $(READY)
	$(BIN)/python -m pytest -m "slow or not slow" tests/docs/test_commands.py $(ARGS)

check: $(READY) docs
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf $(COPY)
	mkdir -p $(COPY)/touchstone
	cp -p touchstone/*.py $(COPY)/touchstone
	cp -pR adapters reference_impl reports scenarios $(COPY)/touchstone
	cd $(COPY)/touchstone && MYPYPATH="$(CURDIR)/$(COPY)" "$(CURDIR)/$(BIN)/mypy" \
		--config-file "$(CURDIR)/pyproject.toml" --cache-dir "$(CURDIR)/.mypy_cache" -p touchstone
	cd $(COPY) && "$(CURDIR)/$(BIN)/lint-imports" \
		--config "$(CURDIR)/pyproject.toml" --cache-dir "$(CURDIR)/.import_linter_cache"

# warnings are errors
docs: $(READY)
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet docs build/docs

$(READY): pyproject.toml setup.py constraints.txt
	$(PYTHON) -m venv .venv
	@echo "installing packages into .venv: a minute or two, without output"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all,dev]'
	touch $@

# wheel and sdist, checked and installed; other interpreters: make release ARGS=python3.12
release:
	PYTHON=$(PYTHON) .ci/release $(ARGS)

clean:
	rm -rf .venv build *.egg-info
