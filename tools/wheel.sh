#!/usr/bin/env bash
# Builds the wheel into out/dist, installs it with its dependencies by pip into a fresh environment, out/wheel, and runs it
# there as a user would: no checkout, no lock files. EXTRAS names extras, such as data,ros.
set -euo pipefail
cd "$(dirname "$0")/.."

environment=$PWD/out/wheel
rm -rf "$environment" out/dist
"${PYTHON:-python3}" -m venv "$environment"
pip=("$environment/bin/python" -m pip --quiet --disable-pip-version-check)
"${pip[@]}" wheel --no-deps --wheel-dir out/dist .
"${pip[@]}" install "$(ls "$PWD"/out/dist/*.whl)${EXTRAS:+[$EXTRAS]}"

cd "$environment"
bin/ldcs scenes >scenes.txt
bin/ldcs simulate paper --duration 0.5 --bag first
bin/ldcs replay first --bag again
bin/ldcs export first -o first.csv
case ",${EXTRAS:-}," in *,data,*) bin/ldcs export first -o first.parquet && bin/ldcs export first -o first.nc ;; esac
case ",${EXTRAS:-}," in *,ros,*) bin/ldcs-sim --ros-args -p scene:=rig -p duration:=1.0 ;; esac
echo "wheel: $(ls "$OLDPWD"/out/dist) runs in an environment of its own"
