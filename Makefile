# `make reproduce` runs everything from the raw logs; `make test` runs every check.
# Both set up their own .venv from the hashed lock first.
PYTHON ?= python3.11
CORES ?= 2
VENV := .venv
# Campaigns measured by others, which are not part of the project: docs/real_data.md.
DATA ?= data
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
# The system's pip installs into the environment: some systems cannot put a pip into a new one.
PIP := $(PYTHON) -m pip --python $(BIN)/python --quiet --disable-pip-version-check
FIRMWARE_TOOLS := gcc-avr avr-libc binutils-avr libsimavr-dev libelf-dev gcc libc6-dev
SLURM_TOOLS := slurm-wlm munge
APT := DEBIAN_FRONTEND=noninteractive timeout 300 apt-get -qq -o Acquire::Retries=0 \
  -o Acquire::http::Timeout=20

.PHONY: help reproduce report docs audit blind real-data repeats test firmware firmware-tools browser \
  slurm-tools scale references release format unlock lock

help:
	@echo "make reproduce   raw logs -> results/ (CORES=$(CORES))"
	@echo "make report      the results as one HTML file -> results/report.html"
	@echo "make docs        the documentation site -> build/site/"
	@echo "make audit       the audit of the paper -> docs/audit.md"
	@echo "make blind       the blind benchmark of the diagnosis -> docs/blind.md (about an hour)"
	@echo "make real-data   diagnose the measured campaigns in DATA -> docs/real_data/"
	@echo "make repeats     diagnose repeated commands in DATA -> docs/blind/ (12 minutes of processor time)"
	@echo "make test        linters, types, contracts, unit tests, reduced workflow"
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
	$(BIN)/python -m spa_fo.report.blind_document results/blind docs \
	  --command "snakemake --cores $(CORES) blind"

report: reproduce
	$(BIN)/snakemake --cores $(CORES) --report results/report.html \
	  --report-stylesheet workflow/report/report.css
	@echo "Open results/report.html in a browser"

audit: reproduce
	$(BIN)/python -m spa_fo.report.audit_document results docs
	cp results/dragon_skin_20/figures/step_responses.png docs/figures/

docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "Open build/site/index.html in a browser"

real-data: $(INSTALLED)
	$(BIN)/python benchmarks/real_data.py $(DATA)

repeats: $(INSTALLED)
	$(BIN)/python benchmarks/measured_repeats.py $(DATA)

test: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint
	$(BIN)/pytest

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
