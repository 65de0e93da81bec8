# `make reproduce` runs everything from the raw logs; `make test` runs every check.
# Both set up their own .venv from the hashed lock first.
PYTHON ?= python3.11
CORES ?= 2
VENV := .venv
# Campaigns measured by others, which are not part of the project: docs/real_data.md.
DATA ?= data
BIN := $(VENV)/bin
# A file's tests stay in one process, as they share what is costly to make. Its threads leave the
# processor to the other process while they wait.
PYTEST := OMP_WAIT_POLICY=passive OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n $(CORES) --dist loadfile --no-loadscope-reorder
INSTALLED := $(VENV)/.installed
# The system's pip installs into the environment: some systems cannot put a pip into a new one.
PIP := $(PYTHON) -m pip --python $(BIN)/python --quiet --disable-pip-version-check
BLIND_COST := (two hours; part: 0.25 in config.yaml, half an hour)
BLIND_SMALL_COST := (two minutes)
FIRMWARE_TOOLS := gcc-avr avr-libc binutils-avr libsimavr-dev libelf-dev gcc libc6-dev
SLURM_TOOLS := slurm-wlm munge
APT := DEBIAN_FRONTEND=noninteractive timeout 300 apt-get -qq -o Acquire::Retries=0 \
  -o Acquire::http::Timeout=20

.PHONY: help reproduce report docs audit blind blind-small real-data static-curve changes injected repeats lint test test-slow \
  test-room firmware firmware-tools browser slurm-tools scale references release format unlock lock

help:
	@echo "make reproduce   raw logs -> results/ (CORES=$(CORES))"
	@echo "make report      the results as one HTML file -> results/report.html"
	@echo "make docs        the documentation site -> build/site/"
	@echo "make audit       the audit of the paper -> docs/audit.md"
	@echo "make blind       the blind benchmark of the diagnosis -> docs/blind.md $(BLIND_COST)"
	@echo "make blind-small a part of it; fails where a mark is missed by more than chance $(BLIND_SMALL_COST)"
	@echo "make real-data   diagnose the measured campaigns in DATA -> docs/real_data/"
	@echo "make static-curve  a curve beside the model on the measured campaigns in DATA -> docs/real_data.md"
	@echo "make changes     what differs between measured logs in DATA -> docs/real_data/changes.md"
	@echo "make injected    changes put into measured repeats in DATA -> docs/real_data/injected.md"
	@echo "make repeats     diagnose repeated commands in DATA -> docs/blind/ (12 minutes of processor time)"
	@echo "make test        linters, types, contracts, unit tests, reduced workflow (a quarter of an hour)"
	@echo "make test-slow   what it leaves out: tests marked slow (eight minutes)"
	@echo "make test-room ROOM=gap   the tests of one room, while you work in it (about a minute)"
	@echo "make lint        linters, types, contracts"
	@echo "make firmware    build the board's program, and a simulated board to run it on"
	@echo "make firmware-tools   install what that needs (Debian, as root)"
	@echo "make slurm-tools      install a Slurm to try the cluster's profile on (Debian, as root)"
	@echo "make scale       cost against size, measured -> docs/scale.md (two hours, on a quiet machine)"
	@echo "make references  CITATION.cff -> docs/references.md"
	@echo "make release     source archive and wheel -> dist/"
	@echo "make browser     install what tests look at pages with (Debian, as root)"
	@echo "make format      format Python and Snakemake files"
	@echo "make unlock      after a killed run: release Snakemake's lock"
	@echo "make lock        resolve the dependencies anew into requirements.lock"

$(INSTALLED): requirements.lock pyproject.toml
	$(PYTHON) -m venv --clear --without-pip $(VENV)
	$(PIP) install --require-hashes -r requirements.lock
	$(PIP) install --no-deps --no-build-isolation --editable .
	touch $@

reproduce: $(INSTALLED)
	$(BIN)/snakemake --cores $(CORES)
	@echo "Start with results/summary.md"

blind: $(INSTALLED)
	$(BIN)/snakemake --cores $(CORES) blind
	$(BIN)/python -m blind.report.document results/blind docs \
	  --command "snakemake --cores $(CORES) blind"

blind-small: $(INSTALLED)
	$(BIN)/snakemake --cores $(CORES) --configfile tests/reduced/blind_small.yaml -- blind
	$(BIN)/python -m blind.judge.check --beyond-chance --published docs/blind/scores.json build/blind_small/blind/scores.json

report: reproduce
	$(BIN)/snakemake --cores $(CORES) --report results/report.html \
	  --report-stylesheet workflow/report/report.css
	@echo "Open results/report.html in a browser"

audit: reproduce
	$(BIN)/python -m spa_fo.report.audit_document results docs
	cp results/dragon_skin_20/figures/step_responses.png \
	  results/dragon_skin_20/diagnosis/opening.png docs/figures/

docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "Open build/site/index.html in a browser"

real-data: $(INSTALLED)
	$(BIN)/python benchmarks/real_data.py $(DATA)

static-curve: $(INSTALLED)
	$(BIN)/python benchmarks/static_curve.py $(DATA)

changes: $(INSTALLED)
	$(BIN)/python benchmarks/measured_changes.py $(DATA)

injected: $(INSTALLED)
	$(BIN)/python benchmarks/injected_changes.py $(DATA)

repeats: $(INSTALLED)
	$(BIN)/python benchmarks/measured_repeats.py $(DATA)

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint

test: lint
	$(PYTEST) -m "not slow and not realtime"
	$(BIN)/pytest -m "realtime and not slow"

test-slow: $(INSTALLED)
	$(PYTEST) -m slow

# A room is any part of the names of its files: rig, gap, identify, plant, report, cli, docs.
ROOM ?= $(error say which: make test-room ROOM=gap)
test-room: $(INSTALLED)
	$(PYTEST) -m "not slow" tests/test_*$(ROOM)*.py

firmware:
	$(MAKE) -C firmware all sim

# Quiet, and quick to give up where there is no network.
define debian
@dpkg-query --show $(1) >/dev/null 2>&1 || { \
  $(APT) update && $(APT) install --yes --no-install-recommends $(1); } >/dev/null
endef

firmware-tools:
	$(call debian,$(FIRMWARE_TOOLS))

slurm-tools:
	$(call debian,$(SLURM_TOOLS))

scale: $(INSTALLED)
	$(BIN)/python benchmarks/bench_scale.py docs --command "make scale"

references: $(INSTALLED)
	$(BIN)/python -m spa_fo.report.references CITATION.cff docs/references.md

release: $(INSTALLED)
	rm -rf dist
	$(BIN)/python -m hatchling build -d dist

browser:
	@dpkg-query --show chromium >/dev/null 2>&1 || { \
	  $(APT) update && $(APT) install --yes --no-install-recommends chromium; } >/dev/null

format: $(INSTALLED)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow

unlock: $(INSTALLED)
	$(BIN)/snakemake --unlock

# uv writes the hashes of every platform and, asked so, no addresses.
lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/pip install --quiet uv
	build/lock/bin/uv pip compile --quiet --universal --python-version 3.11 --extra dev \
	  --generate-hashes --no-emit-index-url --no-header --no-annotate \
	  pyproject.toml --output-file requirements.lock
