"""recover: repairs a bag left incomplete by a killed recorder, a full disk or a power cut."""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from mcap.well_known import Profile

from ldcs_ros.bags.contents import Contents, read_contents, write_copy
from ldcs_ros.bags.metadata import (
    FILE_NAME,
    ROOT_KEY,
    FileSummary,
    bag_information,
    parse_foreign_yaml,
    sync_folder,
    write_metadata,
)
from ldcs_ros.errors import RecordingError, one_line


@dataclass(frozen=True)
class RecoveryReport:
    """The findings and actions of `recover`.

    Attributes:
        path: The bag.
        rewritten: Names of the files that were repaired; empty when all were sound.
        metadata_written: Whether metadata.yaml was missing or wrong and was written again.
        messages: Messages in the bag now.
        duration: Log time from its first to its last message [s].
        dropped: Bytes that could not be used [bytes].
    """

    path: Path
    rewritten: tuple[str, ...]
    metadata_written: bool
    messages: int
    duration: float
    dropped: int

    @property
    def untouched(self) -> bool:
        """The bag was sound and nothing was changed."""
        return not self.rewritten and not self.metadata_written

    def __str__(self) -> str:
        content = f"{self.messages} messages over {self.duration:.3f} s"
        if self.untouched:
            return f"{self.path} is sound ({content}) and was left untouched"
        if not self.rewritten:
            return f"{self.path}: the recorded files are sound ({content}); {FILE_NAME} was written"
        return f"{self.path} was repaired: {content} kept, {self.dropped} bytes dropped"


def recover(
    path: str | os.PathLike[str], *, progress: Callable[[float], None] | None = None
) -> RecoveryReport:
    """Repair an MCAP bag in place; a sound one is left untouched.

    Every whole record is kept, also those of a cut chunk. The new file is written beside the old one and takes its
    name only when it is complete and on the disk. So an interruption or a full disk leaves the old one unchanged.
    custom_data gains the entry `recovered`.

    Args:
        path: Bag folder, or one .mcap file (then no metadata.yaml is written).
        progress: Called with the fraction of the work that is done, 0 to 1.

    Raises:
        RecordingError: Nothing there, no MCAP bag, still being recorded, or no room for the new file.
    """
    bag = Path(path)
    summaries: list[FileSummary] = []
    rewritten: list[str] = []
    dropped = 0
    whole = Contents()
    try:
        metadata = _read_metadata(bag)
        files = _mcap_files(bag)
        done_fraction = _DoneFraction(progress, 2 * sum(file.stat().st_size for file in files))
        for file in files:
            with _locked(file) as stream:
                size = os.fstat(stream.fileno()).st_size
                contents = read_contents(stream, size, done_fraction.at)
                done_fraction.done += size
                if contents.profile is None:
                    raise RecordingError(f"{file} does not begin like an MCAP file; nothing can be kept")
                if contents.profile != Profile.ROS2:
                    raise RecordingError(
                        f"{file} is no ROS 2 bag: its profile is {contents.profile!r}, expected 'ros2'; "
                        "it was left untouched"
                    )
                contents.add_information(metadata)
                if contents.sound:
                    summaries.append(contents.summary(file.name))
                else:
                    contents.custom_data["recovered"] = (
                        f"{contents.counts.total()} messages kept, {contents.dropped} of {size} bytes dropped"
                    )
                    summaries.append(_replace(file, stream, size, contents, done_fraction.at))
                    rewritten.append(file.name)
                    dropped += contents.dropped
                done_fraction.done += size
                whole.custom_data.update(contents.custom_data)
                whole.ros_distro = whole.ros_distro or contents.ros_distro
        information = bag_information(summaries, whole.custom_data, ros_distro=whole.ros_distro)
        metadata_written = bag.is_dir() and (bool(rewritten) or not _agrees(metadata, information))
        if metadata_written:
            write_metadata(bag, information)
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(
            f"{bag} cannot be repaired: {one_line(error)}; it is unchanged. "
            "The repair needs to write there, and room for a second copy"
        ) from error
    return RecoveryReport(
        bag,
        tuple(rewritten),
        metadata_written,
        information["message_count"],
        information["duration"]["nanoseconds"] / 1e9,
        dropped,
    )


@dataclass
class _DoneFraction:
    """A counter that converts positions in files, each read up to twice, to the fraction of the work that is done."""

    progress: Callable[[float], None] | None
    total: int
    done: int = 0

    def at(self, position: int) -> None:
        if self.progress is not None:
            self.progress((self.done + position) / self.total)


def _replace(
    file: Path, stream: IO[bytes], size: int, contents: Contents, progress: Callable[[int], None]
) -> FileSummary:
    part = file.with_name(f".{file.name}.part")
    part.unlink(missing_ok=True)
    summary = write_copy(stream, size, contents, part, file.name, progress)
    os.replace(part, file)
    sync_folder(file.parent)
    return summary


def _mcap_files(bag: Path) -> list[Path]:
    """Return the files of a bag in the order of recording (..._9.mcap before ..._10.mcap)."""
    if not bag.exists():
        raise RecordingError(f"no bag at {bag}; give a bag folder or a .mcap file")
    files = [bag] if bag.is_file() else [file for file in bag.iterdir() if not file.name.startswith(".")]
    found = [file for file in files if file.suffix == ".mcap"]
    if not found:
        hint = "; use `ros2 bag reindex` for sqlite3" if any(file.suffix == ".db3" for file in files) else ""
        raise RecordingError(f"{bag} has no .mcap file to repair{hint}")
    return sorted(found, key=lambda file: [int(part) for part in re.findall(r"\d+", file.name)])


@contextmanager
def _locked(file: Path) -> Iterator[IO[bytes]]:
    """Return the file for reading, unless its recorder is still at work."""
    with open(file, "rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RecordingError(f"{file} is being recorded at this moment; end that run first") from error
        except OSError:
            pass  # a file system without locks
        yield stream


def _read_metadata(bag: Path) -> dict[str, Any]:
    """Return the content of metadata.yaml; empty when it is missing or unreadable."""
    try:
        content = parse_foreign_yaml((bag / FILE_NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    information = content.get(ROOT_KEY) if isinstance(content, dict) else None
    return information if isinstance(information, dict) else {}


def _agrees(metadata: dict[str, Any], information: dict[str, Any]) -> bool:
    """Return whether metadata.yaml names these files and as many messages; other recorders may differ in the rest."""
    return all(metadata.get(key) == information[key] for key in ("relative_file_paths", "message_count"))
