#!/usr/bin/env bash
# Builds ldcs_ros and ldcs_msgs the way a ROS 2 workspace does, and checks what `ros2 run` and Python would find.
set -euo pipefail
cd "$(dirname "$0")/.."
source tools/environment.sh
# Without a distribution the venv is the underlay: ament and the messages stand in it.
export PATH="$PWD/.venv/bin:$PATH" AMENT_PREFIX_PATH="$PWD/.venv${AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH}"

python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --use-pep517 \
    --require-hashes --requirement requirements/colcon.lock
colcon build --base-paths . msg_defs --cmake-args -DBUILD_TESTING=OFF "-DPython3_EXECUTABLE=$PWD/.venv/bin/python"

set +u
source install/setup.bash
cd install
python -c 'import ldcs_ros, ldcs_msgs.msg; print(ldcs_ros.__file__, ldcs_msgs.__file__, sep="\n")'
ls ldcs_ros/lib/ldcs_ros/sim ldcs_ros/share/ldcs_ros/package.xml \
    ldcs_ros/share/ament_index/resource_index/packages/ldcs_ros
