# carom: every target works on a fresh clone with python3 (3.11 or newer), pip and make.
#   make run     install into .venv and run a scene; SCENE=gas2d and ARGS="--seconds 3" choose another
#   make test    the tests, without the slow ones; make test-slow: those; make test-all: both in one run;
#                test-long: more cases and steps of what the others test, before a release
#   make coverage: which lines they run
#   make wheel   a wheel that carries compiled kernels, into dist/
#   make bench   carom against pymunk on this machine; ARGS="--quick" as docs/benchmarks.md says
#   make figures measure again what the tables of accuracy, limits and settings in docs/tables show

PYTHON ?= python3
SCENE ?= asteroids
ARGS ?=

BIN := .venv/bin
# Byte code is made of what is imported, when it is.
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --no-compile

# An editable install holds the folder's path, so a clone that moved installs again.
HERE := $(shell pwd | cksum | cut -d " " -f 1)
VENV := .venv/made-$(HERE)
RUN := .venv/run-$(HERE)
BENCH := .venv/bench-$(HERE)
TEST := .venv/test-$(HERE)
DEV := .venv/dev-$(HERE)

.PHONY: run wheel test test-slow test-all test-long install coverage bench figures ide typecheck lint clean

run: $(RUN)
	$(BIN)/carom run $(SCENE) --out out $(ARGS)

# Byte code is kept, whatever the environment says: or every worker would compile all tests and carom anew in each run.
unexport PYTHONDONTWRITEBYTECODE

WORKERS ?= 2
TOGETHER := -n $(WORKERS) --dist loadfile --no-loadscope-reorder

test: $(TEST)
	$(BIN)/pytest $(TOGETHER) -m "not slow" $(ARGS)

test-slow: $(TEST)
	$(BIN)/pytest $(TOGETHER) -m slow $(ARGS) || [ $$? -eq 5 ]  # 5: nothing is marked slow

test-all: $(TEST)
	$(BIN)/pytest $(TOGETHER) $(ARGS)

test-long: $(TEST)
	$(BIN)/pytest $(TOGETHER) -m long $(ARGS)

# All that the checks need, at once.
install: $(DEV)

# Kernels as plain Python: the same bits as compiled, and which lines of the engine tests have run. What compares them
# comes last: by then the tests beside have compiled them.
PLAIN := components_* systems_* world_* contacts_rows filters_enabled filters_sensors forces_kinds forces_systems \
  sweep_kernels plugins_* plugin_checks plugin_springs adoption array_pool undo vectors profile quarantine saving plain_python

coverage: $(TEST)
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest $(TOGETHER) -m "not slow and not compiled" --cov --cov-report=term $(ARGS) \
	  $(foreach name,$(PLAIN),$(wildcard tests/test_$(name).py))

# A wheel for this platform and Python version that carries the compiled kernels: dist/carom-*.whl.
wheel: $(RUN)
	rm -rf framework/prebuilt build/lib build/bdist*
	$(BIN)/carom warm-up --portable framework/prebuilt
	$(BIN)/python -m pip --disable-pip-version-check wheel --quiet --no-deps --wheel-dir dist .; \
	  status=$$?; rm -rf framework/prebuilt build/lib build/bdist*; exit $$status

bench: $(BENCH)
	$(BIN)/carom bench $(ARGS)

STUDIES := $(BIN)/python -m studies
ACCURACY := spring orbit jump bouncing stack thermal_gas

figures: $(BENCH)
	for scene in $(ACCURACY); do \
	  $(STUDIES) accuracy $$scene --against pymunk --out out/$$scene --into docs/tables/accuracy.md || exit 1; \
	done
	$(STUDIES) accuracy billiards --out out/billiards --into docs/tables/accuracy.md
	cp $(foreach scene,$(filter-out bouncing,$(ACCURACY)) billiards,out/$(scene)/trade-$(scene)-*-work.png) docs/pictures/
	cp out/bouncing/trade-bouncing-*-time.png docs/pictures/
	$(STUDIES) limits --long --into docs/tables/limits.md --out docs/pictures
	$(STUDIES) settings --into docs/tables/settings.md

# Checkers and editors do not follow the import hooks of an editable install; they follow links.
ide:
	rm -rf build/ide
	mkdir -p build/ide/carom
	for file in framework/carom/*; do case $$file in *__pycache__) ;; *) ln -s "../../../$$file" build/ide/carom/ ;; esac; done
	for folder in framework components systems plugins scenes lab; do ln -s "../../../$$folder" build/ide/carom/$$folder; done

typecheck: $(DEV) ide
	$(BIN)/pyright

lint: $(DEV)
	$(BIN)/ruff check

clean:
	rm -rf .venv .kernels .coverage build dist out *.egg-info .pytest_cache .ruff_cache .hypothesis

$(VENV):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "carom needs Python 3.11 or newer; name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	rm -rf .venv
	$(PYTHON) -m venv .venv || { \
	  $(PYTHON) -m venv --clear --without-pip .venv && \
	  $(PYTHON) -m pip --python .venv/bin/python install --quiet pip; }
	touch $@

$(RUN): $(VENV) pyproject.toml
	$(PIP) -e ".[plot]"
	touch $@

$(BENCH): $(VENV) pyproject.toml
	$(PIP) -e ".[bench]"
	touch $@

$(TEST): $(VENV) pyproject.toml
	$(PIP) -e ".[test]"
	touch $@

$(DEV): $(VENV) pyproject.toml
	$(PIP) -e ".[test,dev]"
	touch $(TEST) $@
