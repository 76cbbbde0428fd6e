# Everything a person needs to try, check and measure maniagent; `make help` lists it.

VENV := .venv
BIN := $(VENV)/bin
DEMO := runs/demo
JOBS ?= 2

.DEFAULT_GOAL := help
.PHONY: help demo install dev simpler test check format bench clean
.DELETE_ON_ERROR:

help: ## Say what can be made
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /\1\t/' | expand -t 12

demo: install ## Carry out one instruction in simulation and leave a report in runs/demo
	@$(BIN)/maniagent run --task carrot-on-plate --seed 0 --out $(DEMO); status=$$?; \
	if [ -f $(DEMO)/report.html ]; then echo "Open the report in a browser: $(CURDIR)/$(DEMO)/report.html"; fi; \
	exit $$status

install: $(VENV)/.installed ## Make .venv and see to it that camera images can be drawn

dev: $(VENV)/.installed-dev ## The same, with what the checks need

simpler: dev ## Where SimplerEnv's assets are here, see to it that it runs
	scripts/simpler.sh $(BIN)/python

test: check simpler ## Format, lint, types, then all tests
	$(BIN)/python -m pytest -n $(JOBS)

check: dev ## Format, lint, types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: dev ## Put the code into shape
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: dev ## Measure perception, kinematics, planning, physics, recording; with a model also its answers
	@for script in benchmarks/*.py; do echo "== $$script"; $(BIN)/python "$$script" || exit 1; done

clean: ## Remove what was made here, but no runs
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# Each stamp is newer than all that went into the environment, so that a second call has nothing to do.
$(VENV)/.python: scripts/venv.sh
	scripts/venv.sh $(VENV)
	@touch $@

$(VENV)/.installed: $(VENV)/.python pyproject.toml scripts/software_gl.sh
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	scripts/software_gl.sh $(BIN)/python
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@
