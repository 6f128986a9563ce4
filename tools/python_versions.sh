#!/usr/bin/env bash
# Runs the tests of the rooms without ROS on each Python 3.10 to 3.14 of this machine, each in a venv of its own.
set -euo pipefail
cd "$(dirname "$0")/.."

status=0 tried=0
for version in 3.10 3.11 3.12 3.13 3.14; do
    python=$(command -v "python$version") || { echo "python$version: not on this machine"; continue; }
    venv=$(mktemp -d)
    tried=$((tried + 1))
    if "$python" -m venv "$venv" &&
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --requirement requirements/core.lock &&
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable . &&
        "$venv/bin/python" -m pytest -q test/schema test/physics test/scene test/sensors test/simulation; then
        echo "python$version: passed"
    else
        echo "python$version: FAILED"
        status=1
    fi
    rm -rf "$venv"
done
[ "$tried" -gt 0 ] || { echo "no Python 3.10 to 3.14 on this machine" >&2; exit 1; }
exit "$status"
