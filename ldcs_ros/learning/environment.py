"""`SurfaceEnv`: a scene as an environment of Gymnasium; a point of the sheet is brought to a target."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import gymnasium
import numpy as np

from ldcs_ros.errors import DivergenceError, SceneError
from ldcs_ros.learning.drives import Drives
from ldcs_ros.learning.tasks import TASKS, EpisodeTarget
from ldcs_ros.scene import Scene, load_scene
from ldcs_ros.simulation.threads import one_thread

_LARGEST = 10.0
"""Bound of an observation; a sound one stays below 2."""
EFFORT = 0.02
"""Weight of the change of the action in the reward."""
Info = dict[str, object]


class SurfaceEnv(gymnasium.Env[np.ndarray, np.ndarray]):  # type: ignore[misc]
    """A point of the surface is brought to a target by the pressures (or torques) of the arms.

    Action, shape (n_arms,), -1 ... 1: the command of each arm from 0 to `fraction` of its limit, held for `period`.

    Observation, float32, shape (12 + 2 n_arms,): target minus point (3), target's velocity (3), point's velocity (3),
    point minus its place at rest without commands (3), each over the sheet's length (velocities over it and 1 s);
    then chamber pressure or torque of each arm, and the last action, both in the scale of the action.

    Reward of a step: -d / L - 0.02 mean((a - b)^2), with the distance d of point and target at its end, the sheet's
    length L, the action a and the one before, b.

    An episode is truncated after `duration`. It is terminated with a reward of -1 if the simulation diverges. `info`
    has `distance` [m], and at the end `is_success`: the mean distance over the last third is below `tolerance`.

    Args:
        task: 'reach' or 'follow'; `ldcs_ros.learning.tasks` describes them.
        scene: A scene, or what `load_scene` takes. Its own schedule of commands is left out.
        point: The point.
        period: Time between two actions [s].
        duration: Length of an episode [s].
        accuracy: Accuracy of the simulation [m]; None for the scene's own.
        fraction: Highest command as a fraction of the arms' limit.
        tolerance: Distance that counts as success [m].

    Raises:
        ValueError: There is no such task, or a number is out of its range.
        SceneError: The scene has no arms, no such point, or is not sound.
        DivergenceError: It has no rest state.
    """

    metadata: ClassVar[dict[str, object]] = {"render_modes": []}

    def __init__(
        self,
        task: str = "reach",
        *,
        scene: Scene | str = "rig",
        point: str = "P1",
        period: float = 0.05,
        duration: float = 3.0,
        accuracy: float | None = 1e-4,
        fraction: float = 0.8,
        tolerance: float = 2e-3,
    ) -> None:
        if task not in TASKS:
            raise ValueError(f"got the task {task!r}, expected one of {list(TASKS)}")
        for name, value, highest in (
            ("period", period, np.inf),
            ("duration", duration, np.inf),
            ("fraction", fraction, 1.0),
            ("tolerance", tolerance, np.inf),
        ):
            if not 0.0 < value <= highest or not np.isfinite(value):
                raise ValueError(
                    f"got {name}={value!r}, expected a number above 0{' up to 1' if highest == 1.0 else ''}"
                )
        loaded = (load_scene(scene) if isinstance(scene, str) else scene).without_schedule()
        if point not in loaded.points:
            raise SceneError(f"{loaded.name} has no point {point!r}, only {list(loaded.points)}")
        self.simulation = (loaded if accuracy is None else loaded.with_accuracy(accuracy)).build()
        self._task, self._point = TASKS[task], loaded.points[point]
        self._steps, self._period, self._tolerance = max(1, round(duration / period)), period, tolerance
        self._length = loaded.lattice.size[0]
        with one_thread():
            self.simulation.settle()
        self._rest = self.simulation.state
        self._rest_place = self._point.position(self._rest.position)
        self.drives = Drives(self.simulation, self._point, fraction)
        n = self.drives.count
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-_LARGEST, _LARGEST, (12 + 2 * n,), np.float32)
        self._action = np.full(n, -1.0)
        self._target = EpisodeTarget(self._action, self._rest_place)
        self._start = self.simulation.time
        self._distances: list[float] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[np.ndarray, Info]:
        """Draw a target and return the first observation, shape (n_observed,); a seed fixes the episode."""
        super().reset(seed=seed)
        with one_thread():
            self.simulation.reset(self._rest)
            self._target = self._task.draw(self.drives, self.np_random)
            self._action = self._target.first_action
            if (self._action > -1.0).any():
                self.drives.hold(self._action)
                self.simulation.settle()
        self._start, self._distances = self.simulation.time, []
        return self._observation(), {"distance": self._distance()}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, Info]:
        """Hold an action, shape (n_arms,), for a period; return observation, reward, terminated, truncated, info."""
        before, self._action = self._action, np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        end = self._start + (len(self._distances) + 1) * self._period
        self.drives.hold(self._action)
        try:
            self.simulation.advance_to(end)
        except DivergenceError as error:
            return (
                self._observation(),
                -1.0,
                True,
                False,
                {"distance": self._distance(), "failure": str(error)},
            )
        distance = self._distance()
        self._distances.append(distance)
        reward = -distance / self._length - EFFORT * float(np.mean((self._action - before) ** 2))
        truncated = len(self._distances) >= self._steps
        info: Info = {"distance": distance}
        if truncated:
            info["is_success"] = (
                float(np.mean(self._distances[-max(1, self._steps // 3) :])) < self._tolerance
            )
        return self._observation(), reward, False, truncated, info

    @property
    def length(self) -> float:
        """Length of the sheet, the scale of the observations [m]."""
        return float(self._length)

    @property
    def period(self) -> float:
        """Time between two actions [s]."""
        return self._period

    def slopes(self) -> np.ndarray:
        """Return the point's displacement at rest per unit of action [m], shape (3, n_arms), around the middle.

        Raises:
            DivergenceError: There is no rest state.
        """
        middle, step = np.zeros((1, self.drives.count)), 0.05
        with one_thread():
            present = self.simulation.state
            self.simulation.reset(self._rest)
            shifts = step * np.eye(self.drives.count)
            ahead, behind = (self.drives.rest_positions(middle + sign * shifts) for sign in (1.0, -1.0))
            self.simulation.reset(present)
        slopes: np.ndarray = (ahead - behind).T / (2.0 * step)
        return slopes

    def _since_start(self) -> float:
        return self.simulation.time - self._start

    def _distance(self) -> float:
        place = self._point.position(self.simulation.state.position)
        return float(np.linalg.norm(place - self._target.position(self._since_start())))

    def _observation(self) -> np.ndarray:
        state, time = self.simulation.state, self._since_start()
        place = self._point.position(state.position)
        parts = (
            (self._target.position(time) - place) / self._length,
            self._target.velocity(time) / self._length,
            # Positions of a point are linear in those of the nodes, and so are velocities.
            self._point.position(state.velocity) / self._length,
            (place - self._rest_place) / self._length,
            self.drives.present(),
            self._action,
        )
        return np.clip(np.concatenate(parts), -_LARGEST, _LARGEST).astype(np.float32)


def make_vector(count: int, *, processes: bool = True, **settings: object) -> gymnasium.vector.VectorEnv:
    """Return several environments that step together, each in a process of its own or all in this one.

    Args:
        count: Number of environments.
        processes: One process each (spawned); a script needs `if __name__ == "__main__":` then.
        **settings: Arguments of `SurfaceEnv`.
    """
    makers = [partial(SurfaceEnv, **settings) for _ in range(count)]  # type: ignore[arg-type]
    if processes:
        return gymnasium.vector.AsyncVectorEnv(makers, context="spawn")
    return gymnasium.vector.SyncVectorEnv(makers)


for _name in TASKS:
    # gymnasium.make("ldcs_ros.learning:ldcs/Reach-v0")
    gymnasium.register(
        f"ldcs/{_name.capitalize()}-v0",
        entry_point="ldcs_ros.learning.environment:SurfaceEnv",
        kwargs={"task": _name},
    )
