"""The topics of the bridge beside the twin's: the rig in the twin's terms, residuals, the estimate."""

from __future__ import annotations

from collections.abc import Iterable

from ldcs_ros.messages.topics import Topic

_RIG_POSE = "geometry_msgs/msg/PoseStamped"
_POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
_VECTOR = "geometry_msgs/msg/Vector3Stamped"


def bridge_topics(points: Iterable[str], arms: Iterable[str], *, estimate: bool) -> dict[str, Topic]:
    """Return the bridge's own topics by name."""
    topics = []
    for point in points:
        topics.append(Topic(f"rig/{point}/pose", _RIG_POSE, "out", "pose measured by the rig's tracker"))
        topics.append(Topic(f"residual/{point}", _VECTOR, "out", "measured minus predicted position [m]"))
        if estimate:
            meaning = "estimated pose, with the filter's own covariance of the position"
            topics.append(Topic(f"estimate/{point}/pose", _POSE_COVARIANCE, "out", meaning))
    for arm in arms:
        meaning = "pressure measured by the rig, absolute [Pa]"
        topics.append(Topic(f"rig/{arm}/pressure", "sensor_msgs/msg/FluidPressure", "out", meaning))
    if estimate:
        topics.append(
            Topic("estimate/nodes", "sensor_msgs/msg/PointCloud2", "out", "estimated nodes, as `nodes`")
        )
    return {topic.name: topic for topic in topics}
