"""recover: repairs a bag left incomplete by a killed recorder, a full disk or a power cut."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from ldcs_ros.bags.contents import Contents, read_contents, write_copy
from ldcs_ros.bags.durable import lock, sync_folder
from ldcs_ros.bags.limits import check_regular
from ldcs_ros.bags.mcap_records import MAGIC
from ldcs_ros.bags.metadata import (
    FILE_NAME,
    BagMetadata,
    FileSummary,
    bag_information,
    read_metadata,
    write_metadata,
)
from ldcs_ros.bags.reader import read_bag
from ldcs_ros.bags.storage import LATEST
from ldcs_ros.errors import RecordingError, one_line, user_path


@dataclass(frozen=True)
class RecoveryReport:
    """The findings and actions of `recover`.

    Attributes:
        path: The bag.
        rewritten: Names of the files that were repaired; empty when all were sound.
        originals: Names of the files as they were before, kept beside the repaired ones.
        metadata_written: Whether metadata.yaml was missing or wrong and was written again.
        messages: Messages in the bag now.
        duration: Log time from its first to its last message [s].
        dropped: Bytes that could not be used [bytes].
        left_out: Names of files without any content, which are no part of the bag now.
        refusal: Reason for which readers refuse the bag nevertheless; '' if they read it.
    """

    path: Path
    rewritten: tuple[str, ...]
    originals: tuple[str, ...]
    metadata_written: bool
    messages: int
    duration: float
    dropped: int
    left_out: tuple[str, ...] = ()
    refusal: str = ""

    @property
    def untouched(self) -> bool:
        """The bag was sound and nothing was changed."""
        return not self.rewritten and not self.metadata_written

    def __str__(self) -> str:
        content = f"{self.messages} messages over {self.duration:.3f} s"
        kept = f"; the original stays as {', '.join(self.originals)}" if self.originals else ""
        if self.untouched:
            words = f"{self.path} is sound ({content}) and was left untouched"
        elif not self.rewritten:
            words = f"{self.path}: the recorded files are sound ({content}); {FILE_NAME} was written{kept}"
        else:
            words = f"{self.path} was repaired: {content} kept, {self.dropped} bytes dropped{kept}"
        return words + (f"; left out, since empty: {', '.join(self.left_out)}" if self.left_out else "")


def recover(
    path: str | os.PathLike[str], *, progress: Callable[[float], None] | None = None
) -> RecoveryReport:
    """Repair an MCAP bag in place; a sound one is left untouched.

    Every whole record is kept, also those of a cut chunk. The new file is written beside the old one and takes its
    name only when it is complete and on the disk. The old one stays beside it under the suffix `.original`, until the
    user removes it. custom_data gains the entry `recovered`.

    Args:
        path: Bag folder, or one .mcap file (then no metadata.yaml is written). Where metadata.yaml lists files,
            others in the folder are left out.
        progress: Called with the fraction of the work that is done, 0 to 1.

    Raises:
        RecordingError: Nothing there, no MCAP bag, still being recorded, or no room for the new file.
    """
    bag = user_path(path)
    summaries: list[FileSummary] = []
    rewritten: list[str] = []
    originals: list[str] = []
    left_out: list[str] = []
    dropped = 0
    whole = Contents()
    try:
        metadata = _metadata(bag)
        files = _mcap_files(bag, metadata)
        done_fraction = _DoneFraction(progress, 2 * sum(check_regular(file) for file in files))
        for file in files:
            with _locked(file) as stream:
                size = os.fstat(stream.fileno()).st_size
                contents = read_contents(file, stream, size, done_fraction.at)
                done_fraction.done += size
                if len(files) > 1 and contents.profile is None and _is_empty(stream):
                    left_out.append(file.name)
                    done_fraction.done += size
                    continue
                _check_contents(file, contents)
                contents.add_bag_metadata(metadata)
                if contents.sound:
                    summaries.append(contents.summary(file.name))
                else:
                    contents.custom_data["recovered"] = (
                        f"{contents.counts.total()} messages kept, {contents.dropped} of {size} bytes dropped"
                    )
                    summaries.append(_copy(file, stream, size, contents, done_fraction.at))
                    originals.append(_replace(file))
                    rewritten.append(file.name)
                    dropped += contents.dropped
                done_fraction.done += size
                whole.custom_data.update(contents.custom_data)
                whole.ros_distro = whole.ros_distro or contents.ros_distro
        if not summaries:
            raise RecordingError(f"{bag} has only empty files; nothing can be kept")
        information = bag_information(
            summaries,
            whole.custom_data,
            ros_distro=whole.ros_distro,
            packed_messages=metadata.compression == "message",
        )
        metadata_written = bag.is_dir() and (bool(rewritten) or not _agrees(metadata, information))
        if metadata_written:
            if (bag / FILE_NAME).exists():
                originals.append(_keep(bag / FILE_NAME))
            write_metadata(bag, information)
    except RecordingError:
        raise
    except OSError as error:
        state = f"only {', '.join(rewritten)} is repaired" if rewritten else "it is unchanged"
        raise RecordingError(
            f"{bag} cannot be repaired: {one_line(error)}; {state}. "
            "The repair needs to write there, and room for a second copy"
        ) from error
    return RecoveryReport(
        bag,
        tuple(rewritten),
        tuple(originals),
        metadata_written,
        information["message_count"],
        information["duration"]["nanoseconds"] / 1e9,
        dropped,
        tuple(left_out),
        _refusal(bag),
    )


def _is_empty(stream: IO[bytes]) -> bool:
    """Tell a file that a power cut left without content, or filled with zeros."""
    stream.seek(0)
    opening = stream.read(len(MAGIC))
    return MAGIC.startswith(opening) or opening == bytes(len(opening))


def _refusal(bag: Path) -> str:
    """Return the reason for which a bag cannot be read; '' if it can."""
    try:
        read_bag(bag)
    except RecordingError as error:
        return str(error)
    return ""


def _check_contents(file: Path, contents: Contents) -> None:
    if contents.profile is None:
        raise RecordingError(f"{file} does not begin like an MCAP file; nothing can be kept")
    encodings = {channel.message_encoding for channel in contents.channels.values()}
    if encodings and "cdr" not in encodings:
        raise RecordingError(
            f"{file} holds no ROS 2 messages: its profile is {contents.profile!r}, its encodings are "
            f"{sorted(encodings)}; it was left untouched"
        )
    if contents.counts.total() and contents.end > LATEST:
        raise RecordingError(
            f"{file} has a log time of {contents.end} ns, after the year 2262: no repair knows the right one; "
            "it was left untouched"
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


def _copy(
    file: Path, stream: IO[bytes], size: int, contents: Contents, progress: Callable[[int], None]
) -> FileSummary:
    part = _part(file)
    part.unlink(missing_ok=True)
    return write_copy(stream, size, contents, part, file.name, progress)


def _part(file: Path) -> Path:
    return file.with_name(f".{file.name}.part")


def _replace(file: Path) -> str:
    """Give the finished copy the name of its original; return the name under which that stays."""
    original = _keep(file)
    os.replace(_part(file), file)
    sync_folder(file.parent)
    return original


def _keep(file: Path) -> str:
    """Give a file another name, which no reader of bags takes for a bag's file, and return it."""
    number = 1
    while (original := file.with_name(f"{file.name}.original{number if number > 1 else ''}")).exists():
        number += 1
    try:
        os.link(file, original)
    except OSError:  # a file system without links
        shutil.copy2(file, original)
    return original.name


def _mcap_files(bag: Path, metadata: BagMetadata) -> list[Path]:
    """Return the files of a bag in the order of recording (..._9.mcap before ..._10.mcap)."""
    if not bag.exists():
        raise RecordingError(f"no bag at {bag}; give a bag folder or a .mcap file")
    if not bag.is_dir():
        names = {bag.name}
    else:
        here = {file.name for file in bag.iterdir() if not file.name.startswith(".")}
        names = here & set(metadata.files) or {
            name for name in here if name.endswith((".mcap", ".db3", ".zstd"))
        }
    found = [name for name in names if name.endswith(".mcap")]
    if not found or len(found) < len(here & set(metadata.files) if bag.is_dir() else names):
        hint = ""
        if any(name.endswith(".db3") for name in names):
            hint = "; use `ros2 bag reindex` for sqlite3"
        elif any(name.endswith(".zstd") for name in names):
            hint = "; unpack its files with `zstd -d` first"
        raise RecordingError(f"{bag} has no .mcap file to repair{hint}")
    folder = bag if bag.is_dir() else bag.parent
    return [folder / name for name in sorted(found, key=_numbers)]


def _numbers(name: str) -> list[int]:
    return [int(part) for part in re.findall(r"\d{1,18}", name)]


@contextmanager
def _locked(file: Path) -> Iterator[IO[bytes]]:
    """Return the file for reading, unless its recorder is still at work."""
    with open(file, "rb") as stream:
        try:
            lock(stream)
        except BlockingIOError as error:
            raise RecordingError(f"{file} is being recorded at this moment; end that run first") from error
        except OSError:
            pass  # a file system without locks
        yield stream


def _metadata(bag: Path) -> BagMetadata:
    """Return the content of metadata.yaml; empty when it is missing or unreadable."""
    try:
        return read_metadata(bag) if bag.is_dir() else BagMetadata({})
    except RecordingError:
        return BagMetadata({})


_NEEDED = ("storage_identifier", "relative_file_paths", "message_count", "starting_time", "duration")


def _agrees(metadata: BagMetadata, information: dict[str, Any]) -> bool:
    """Return whether metadata.yaml agrees in what readers need: files, span, counts and types of topics."""
    said = metadata.content
    return all(said.get(key) == _as_text(information[key]) for key in _NEEDED) and _topics(
        said.get("topics_with_message_count")
    ) == _topics(_as_text(information["topics_with_message_count"]))


def _as_text(value: object) -> object:
    if isinstance(value, dict):
        return {key: _as_text(item) for key, item in value.items()}
    return [_as_text(item) for item in value] if isinstance(value, list) else str(value)


def _topics(listed: object) -> set[tuple[str, ...]]:
    """Return the topics with messages; recorders differ in listing the others."""
    found: set[tuple[str, ...]] = set()
    for one in listed if isinstance(listed, list) else ():
        said = one.get("topic_metadata") if isinstance(one, dict) else None
        if isinstance(said, dict) and one.get("message_count") != "0":
            found.add((*(str(said.get(key)) for key in _TOPIC_KEYS), str(one.get("message_count"))))
    return found


_TOPIC_KEYS = ("name", "type", "serialization_format")
