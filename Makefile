# Needs python3 (3.11 or newer), pip and make; a clone that moved needs `make clean`. Options of a command: ARGS="--seconds 3".
PYTHON ?= python3
SCENE ?= asteroids
WORKERS ?= 2
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
PYTEST := $(BIN)/pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder
unexport PYTHONDONTWRITEBYTECODE  # or every worker would compile all tests and carom anew in each run

.PHONY: run install check test test-slow test-long test-numba coverage kernels wheel wheels release docs bench figures typecheck lint clean

run: .venv/plot  # a scene, with pictures in out/
	$(BIN)/carom run $(SCENE) --out out $(ARGS)
install: .venv/checks  # all that the checks need
test: .venv/test
	$(PYTEST) -m "not slow" $(ARGS)
check: .venv/checks  # before a release: all but the long ones, on the library of kernels, on numba's own and in plain Python
	.ci/run
	$(MAKE) test-slow coverage test-numba docs
test-slow: .venv/test
	$(PYTEST) -m slow $(ARGS)
test-long: .venv/test  # more cases and steps of what the others test, before a release
	$(PYTEST) -m long $(ARGS)
	NUMBA_DISABLE_JIT=1 $(PYTEST) -m long tests/jit/test_plain_python.py
test-numba: .venv/test  # some laws on kernels that numba has compiled here, not on the library of them
	CAROM_LIBRARY=0 $(PYTEST) $(addprefix tests/laws/test_,energy.py loads.py symmetry.py turning.py) $(ARGS)
coverage: .venv/test  # which lines of the engine the tests run: kernels as plain Python, with the same bits as compiled
	NUMBA_DISABLE_JIT=1 $(PYTEST) -m "plain and not compiled" --cov --cov-report=term $(ARGS) \
	  $$(grep -rl --include="test_*.py" "mark\.plain" tests | sort)  # all others would be collected in vain
kernels: .venv/build  # a library of all that ships, beside the package: what is not edited then compiles no more
	$(BIN)/carom build
wheel: .venv/build  # for this platform and every Python, with compiled kernels, into dist/
	$(BIN)/python -m carom.lab.build.wheel dist
wheels: .venv/build  # for all platforms
	$(BIN)/python -m carom.lab.build.wheel dist linux-x86_64 linux-aarch64 macos-arm64 win-amd64 wasm32
release: .venv/build  # make release VERSION=0.2.0 DRY=1; see docs/releases.md
	$(BIN)/python -m studies.release $(VERSION) $(if $(DRY),--dry-run) $(ARGS)
docs: .venv/docs  # the site, into build/docs/site; ARGS="--live FOLDER" with scenes that run, needs Pyodide and `make install`
	$(BIN)/python -m studies.site $(ARGS)
bench: .venv/bench  # carom against pymunk and Box2D; ARGS="--quick", see docs/benchmarks.md
	$(BIN)/python -m studies bench $(ARGS)
typecheck: .venv/test .venv/dev .venv/docs
	$(BIN)/pyright
lint: .venv/dev
	$(BIN)/ruff check
clean:
	rm -rf .venv .kernels .coverage build dist out *.egg-info src/*.egg-info .pytest_cache .ruff_cache .hypothesis

.venv/checks: pyproject.toml | .venv/bin/python
	@echo "installing carom, and all that its checks need, into .venv"
	$(PIP) install --quiet --no-compile -e ".[test,dev,build,docs]"
	touch .venv/test .venv/dev .venv/build .venv/docs $@
.venv/%: pyproject.toml | .venv/bin/python  # the extras of pyproject.toml
	@echo "installing carom with its extra $* into .venv"
	$(PIP) install --quiet --no-compile -e ".[$*]"
	touch $@
.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "carom needs Python 3.11 or newer; name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	$(PYTHON) -m venv .venv || { $(PYTHON) -m venv --clear --without-pip .venv && $(PYTHON) -m pip --python $@ install --quiet pip; }

STUDIES := $(BIN)/python -m studies

figures: .venv/bench  # measure again what the tables and charts of docs/tables show
	$(STUDIES) accuracy --into docs/tables/accuracy.md --out docs/pictures
	$(STUDIES) limits --into docs/tables/limits.md --out docs/pictures
	$(STUDIES) settings --into docs/tables/settings.md
