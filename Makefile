# make demo: set up, parse a bundled map, learn, print an explained plan.   make test: set up, run every check.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin

.PHONY: demo test clean

demo: $(VENV)/.installed
	$(BIN)/qualrl run maps/office.scenario.yaml -o results/demo
	@echo "pictures: results/demo/overlay.png, results/demo/learning_curve.png"

test: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo
	$(BIN)/pytest --numprocesses=auto --cov --cov-report=term

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "qualrl needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.12 demo"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/.installed: $(VENV)/.created pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.installed-test: $(VENV)/.created pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --only-binary=:all: 'stormpy>=2.0' 2>/dev/null || \
	    echo "the model checker Storm has no wheel for this machine; the tests that ask it are skipped"
	touch $(VENV)/.installed $@

clean:
	rm -rf $(VENV) results
