#!/usr/bin/env bash
# Writes requirements/*.lock anew: the newest versions that fit together on Linux x86-64, CPython 3.10 to 3.14, each with
# the hashes of its files. KEEP=1 keeps the versions and writes their hashes only.
# Needs uv (pip install uv); commit the result after `make test`.
set -euo pipefail
cd "$(dirname "$0")/.."

# compile INPUT OUTPUT [option...]: pins with one marker a line, only where versions differ by Python. A lock names no
# registry: whichever serves a file of these hashes may.
compile() {
    local input=$1 output=$2
    shift 2
    {
        printf '# Written by tools/lock.sh; do not edit. Linux x86-64, CPython 3.10 to 3.14.\n'
        uv pip compile --quiet --universal --python-version 3.10 --no-header --no-annotate --no-emit-index-url \
            --generate-hashes ${KEEP:+--constraint "$output"} "$@" "$input" |
            sed -E "s/ and \(\(platform_machine == .*\)\)//; s/platform_python_implementation == 'CPython' and sys_platform == 'linux'//; s/ and +\\\\$/ \\\\/; s/ ; +\\\\$/ \\\\/"
    } >"$output.new"
    mv "$output.new" "$output"
}

compile setup.py requirements/core.lock --extra dev --extra rig --extra data --extra rl --constraint requirements/constraints.txt
compile requirements/ros.in requirements/ros.lock --constraint requirements/core.lock
compile requirements/cluster.in requirements/cluster.lock --constraint requirements/core.lock
compile requirements/view.in requirements/view.lock --constraint requirements/core.lock --constraint requirements/ros.lock
compile requirements/colcon.in requirements/colcon.lock --constraint requirements/core.lock --constraint requirements/ros.lock
compile requirements/coverage.in requirements/coverage.lock --constraint requirements/core.lock
compile requirements/mutants.in requirements/mutants.lock --constraint requirements/core.lock
compile requirements/finite_elements.in requirements/finite_elements.lock --no-deps --constraint requirements/core.lock
compile requirements/site.in requirements/site.lock --constraint requirements/core.lock
compile requirements/notebooks.in requirements/notebooks.lock --constraint requirements/core.lock
