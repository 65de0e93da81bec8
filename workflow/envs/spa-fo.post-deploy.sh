#!/usr/bin/env bash
# Runs in the new environment: the locked packages, then this one.
set -euo pipefail
python -m pip install --require-hashes -r requirements.lock
python -m pip install --no-deps --no-build-isolation --editable .
