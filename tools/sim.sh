#!/usr/bin/env bash
# Runs the live node on a scene and records it; the variables are those of `make sim`.
set -euo pipefail
cd "$(dirname "$0")/.."
source tools/environment.sh

scene=${SCENE:-paper}
# Time and process id: no two runs share a folder, and the recorder refuses one that exists.
record=${RECORD:-out/$(basename "$scene" .yaml)-$(date +%Y%m%d-%H%M%S)-$$}

# number NAME VALUE: the value as ROS expects a double, '1' as '1.0'.
number() {
    [[ $2 =~ ^-?[0-9]+(\.[0-9]+)?$ ]] || { echo "make sim: $1 is '$2'; expected a number, for example $1=2" >&2; exit 2; }
    [[ $2 == *.* ]] && echo "$2" || echo "$2.0"
}

# text VALUE: quoted for YAML, so that a scene named 1 stays a name.
text() { printf "'%s'" "${1//\'/\'\'}"; }

real_time_factor=$(number RTF "${RTF:-1}")
duration=$(number DURATION "${DURATION:-0}")

# On this machine only, unless NETWORK=1 or the user has settings of their own: see the profile.
if [ "${NETWORK:-0}" != 1 ]; then
    variable=FASTDDS_DEFAULT_PROFILES_FILE
    case ${ROS_DISTRO:-} in humble | iron | jazzy) variable=FASTRTPS_DEFAULT_PROFILES_FILE ;; esac  # before Fast DDS 3
    [ -n "${!variable:-}" ] || export "$variable=$PWD/ldcs_ros/config/fastdds_local.xml"
    # Other middleware does not read the profile.
    [ "${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp}" = rmw_fastrtps_cpp ] || export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
fi

mkdir -p "$(dirname "$record")"
export PYTHONUNBUFFERED=1
exec .venv/bin/python -m ldcs_ros.ros sim --ros-args \
    -p scene:="$(text "$scene")" -p record:="$(text "$record")" \
    -p real_time_factor:="$real_time_factor" -p duration:="$duration"
