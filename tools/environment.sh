# To be sourced from the checkout: where a ROS 2 distribution finds ldcs_msgs, which `make setup` installs into .venv/.
# With the ROS wheels nothing is needed: every Python of the venv sets its own library path.
if [ -n "${ROS_DISTRO:-}" ]; then
    export AMENT_PREFIX_PATH="$PWD/.venv${AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH}"
    export LD_LIBRARY_PATH="$PWD/.venv/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
fi
