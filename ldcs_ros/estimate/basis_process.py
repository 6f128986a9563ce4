"""`BasisProcess`: the search for a scene's main directions in a process of its own, beside a running loop."""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile

import numpy as np

from ldcs_ros.errors import DivergenceError, LdcsError
from ldcs_ros.estimate.basis import equilibria, main_directions
from ldcs_ros.scene import Scene
from ldcs_ros.simulation.threads import one_thread

Basis = tuple[np.ndarray, np.ndarray]
"""Mean shape, shape (n_coordinates,), and main directions, shape (count, n_coordinates) [m, rad]."""


class BasisProcess:
    """A search that takes seconds and a core; files instead of pipes, so that neither side waits.

    Args:
        scene: A scene whose arms are driven by pressure.
        point: Point that carries the loads.
        count: Number of directions.
    """

    def __init__(self, scene: Scene, point: str, count: int) -> None:
        self._answer = tempfile.TemporaryFile()  # noqa: SIM115  # open until `close`
        with tempfile.TemporaryFile() as question:
            pickle.dump((scene, point, count), question)
            question.seek(0)
            # A session of its own: Ctrl-C reaches the parent alone, which closes this process.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "ldcs_ros.estimate.basis_process"],
                stdin=question,
                stdout=self._answer,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def result(self) -> Basis | None:
        """Return the basis, or None while the search goes on.

        Raises:
            DivergenceError: The search failed.
        """
        status = self._process.poll()
        if status is None:
            return None
        self._answer.seek(0)
        if status != 0:
            words = self._answer.read().decode("utf-8", "replace").strip()
            raise DivergenceError(words or f"the search for the modes ended with status {status}")
        mean, directions = pickle.load(self._answer)
        return mean, directions

    def wait(self, timeout: float) -> None:
        """Wait for the end of the search [s]; raises subprocess.TimeoutExpired."""
        self._process.wait(timeout)

    def close(self) -> None:
        """End the search."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._answer.close()


def main() -> int:
    """Read scene, point and count from standard input, write the basis to standard output; return the exit status."""
    scene, point, count = pickle.load(sys.stdin.buffer)
    try:
        with one_thread():
            basis = main_directions(equilibria(scene, point), count)
    except LdcsError as error:
        print(error)
        return 1
    pickle.dump(basis, sys.stdout.buffer)
    return 0


if __name__ == "__main__":
    sys.exit(main())
