# Every target makes .venv itself when it is missing or when what should be in it has changed.

.DEFAULT_GOAL := help
.PHONY: run see test fuzz tools check bench wheel docs docs-test pictures trials-proof logs-proof review-proof interrupts reliability-proof observer-proof clean help

BIN := .venv/bin
WALK := .venv/installed
STAMP := .venv/tools

# The first supported interpreter that really starts and can make environments: a shim may exist and fail.
PYTHON ?= $(shell for python in python3.13 python3.12 python3.11 python3.14 python3; do \
	$$python -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 15))' \
	>/dev/null 2>&1 && echo $$python && break; done)

run: $(WALK)  ## walk: the default scenario, or ARGS="undisturbed --steps 5"
	@$(BIN)/cmpc run $(ARGS)

see: $(WALK)  ## walk and fall: the same push with and without the MPC, both runs as one page in the browser
	@mkdir -p logs && folder=$$(mktemp -d logs/see-XXXXXX) \
		&& $(BIN)/cmpc run push-25N --log $$folder/c-mpc.mcap \
		&& $(BIN)/cmpc run push-25N --controller zd-pd --log $$folder/zd-pd.mcap \
		&& $(BIN)/cmpc review $$folder/c-mpc.mcap $$folder/zd-pd.mcap --out $$folder/both.html --open

test: $(STAMP)  ## run the tests, or some: ARGS="tests/test_qp.py"
	@$(BIN)/python -m pytest -n 2 --dist worksteal $(ARGS)

fuzz: $(STAMP)  ## 2,000 seeded mutations of every kind of file through the commands that read them, some 40 minutes
	@$(BIN)/python tests/fuzz.py $(ARGS)

tools: $(STAMP)  ## tests of what browsers, Node, pyarrow and OpenGL make of a log; needs npm, uses what is there
	@$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e ".[dev,live,parquet,video]"
	@npm ci --silent --prefix tests/node
	@$(BIN)/python -m pytest -ra tests/test_logs.py tests/test_node_reader.py tests/test_review_page.py tests/test_review_browser.py tests/test_pages.py tests/test_film.py tests/test_live.py tests/test_rerun.py

check: $(STAMP)  ## lint, format, types and import contracts
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo

bench: $(STAMP)  ## measure ticks, solves and runs against their targets, or ARGS="--quick"
	@$(BIN)/cmpc bench $(ARGS)

wheel: $(STAMP)  ## build the wheel, and walk with it alone in an empty folder
	@$(BIN)/python tests/wheel.py

docs: $(STAMP)  ## build the site of docs/ into site/, every link checked; draw the picture of the architecture
	@$(BIN)/python docs/architecture.py
	@$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e ".[docs]"
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q

docs-test: $(STAMP)  ## run every command block and snippet of README and docs, and every example, some ten minutes
	@$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e ".[dev,live,parquet,video]"
	@$(BIN)/python tests/documents.py $(ARGS)
	@$(BIN)/python -m pytest -m campaign tests/test_readme.py tests/test_examples.py

pictures: $(STAMP)  ## make the pictures of the pages in docs/ anew; needs Chromium
	@$(BIN)/python docs/pictures.py $(ARGS)

trials-proof: $(STAMP)  ## the long proofs about campaigns: kills, a cluster, 10,000 trials, full disks
	@$(BIN)/python -m pytest -m campaign -rA --durations=0 tests/test_trials_campaign.py $(ARGS)

logs-proof: $(STAMP)  ## 1000 mutated logs and 100 falsified results through every command, some 40 minutes
	@CMPC_MUTATIONS=1000 CMPC_FALSE=100 $(BIN)/python -m pytest tests/test_log_mutations.py tests/test_log_false.py $(ARGS)

review-proof: $(STAMP)  ## 24 made-up falls and those of the campaigns, on the first screen of their pages; what --live costs; Rerun's picture
	@$(BIN)/python -m pytest -m campaign -s tests/test_review_falls.py tests/test_live.py tests/test_rerun.py $(ARGS)

interrupts: $(STAMP)  ## Ctrl-C at 40 random moments of 10 commands, some five minutes
	@$(BIN)/python tests/interrupts.py $(ARGS)

reliability-proof: $(STAMP)  ## searches for the nearest fall and its probability on limit states with known answers
	@$(BIN)/python -m tests.reliability_proof $(ARGS)

observer-proof: $(STAMP)  ## how well the observer sees a push through wrong masses, bias, noise and a load: a table, half a minute
	@$(BIN)/python -m tests.observer_proof

clean:  ## remove the environment and every cache; logs stay
	rm -rf .venv build dist site .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find controller sim models tests -name __pycache__ -prune -exec rm -rf {} +

help:  ## show this
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' Makefile | column -t -s '|'

# A dot every 2 s while the rest of a recipe's line goes on, which must stand in the foreground to hear Ctrl-C.
DOTS = while sleep 2; do printf .; done & dots=$$!; trap "kill $$dots; echo" EXIT; trap "exit 130" INT TERM;
INSTALL := $(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt

$(WALK): pyproject.toml constraints.txt
	@$(BIN)/python -c '' 2>/dev/null || { \
		test -n "$(PYTHON)" || { \
			echo "make: no usable Python: need 3.11 to 3.14 with venv (on Debian: python3-venv);" \
				"give one with PYTHON=/path/to/python3" >&2; exit 1; }; \
		printf "Making .venv with $$($(PYTHON) --version), once "; \
		$(DOTS) $(PYTHON) -m venv --clear .venv; }
	@printf "Installing packages (1 of 2) "; $(DOTS) $(INSTALL) -e .
	@echo "Compiling kernels (2 of 2)"
	@$(BIN)/python -m sim.bridge.kernels
	@touch $@

$(STAMP): $(WALK)
	@printf "Installing what tests and tools take "; $(DOTS) $(INSTALL) -e ".[dev]"
	@touch $@
