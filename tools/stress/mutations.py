"""Damaged and hostile variants of bags and of YAML files, each drawn by a generator."""

from __future__ import annotations

import random
import re
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

EXTREMES = (0, 1, 127, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**48, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
NUMBERS = (
    "0",
    "-1",
    "1e-300",
    "1e308",
    ".nan",
    ".inf",
    "0502",
    "9" * 400,
    "69.0e3",
    "1_000",
    "0x1F",
    "2001-99-99",
)
GARBAGE = (
    "[", "]", "{", "}", ":", "- ", "&a", "*a", "!!timestamp 1", "!!python/object:os.system x", "? ", "|", ">", "'",
    '"', "\t", "\u0000", "\ud7ff", "<<: *a", "---\n", "...\n", "%YAML 9.9\n", "~", "null", "yes", "#",
    "\u2028", "a" * 5000,
)  # fmt: skip


def mutate_bytes(data: bytes, draw: random.Random) -> bytes:
    """Return bytes with flips, zeros, extreme numbers, a cut, a repetition or a part left out."""
    content = bytearray(data)
    size = len(content)
    kind = draw.choice(("flip", "flip", "flips", "zeros", "number", "number", "cut", "repeat", "leave"))
    place = draw.randrange(size)
    length = min(draw.choice((1, 8, 64, 512)), size - place)
    if kind in ("flip", "flips"):
        for _ in range(1 if kind == "flip" else draw.randrange(2, 40)):
            content[draw.randrange(size)] ^= 1 << draw.randrange(8)
    elif kind == "zeros":
        content[place : place + length] = bytes(length)
    elif kind == "number":
        width, layout = draw.choice(((2, "<H"), (4, "<I"), (8, "<Q")))
        if size > width:
            value = draw.choice(EXTREMES) % (1 << 8 * width)
            struct.pack_into(layout, content, draw.randrange(size - width), value)
    elif kind == "cut":
        del content[place:]
    elif kind == "repeat":
        content[place:place] = content[place : place + length]
    else:
        del content[place : place + length]
    return bytes(content)


def mutate_text(text: str, draw: random.Random) -> str:
    """Return YAML text with one to four changes of lines, values and structure."""
    for _ in range(draw.randrange(1, 5)):
        text = draw.choice(_TEXT_CHANGES)(text, draw)
    return text


def _number(text: str, draw: random.Random) -> str:
    found = list(re.finditer(r"[-+]?\d[\d.e+-]*", text))
    if not found:
        return text
    one = draw.choice(found)
    return text[: one.start()] + draw.choice(NUMBERS) + text[one.end() :]


def _insert(text: str, draw: random.Random) -> str:
    place = draw.randrange(len(text) + 1)
    return text[:place] + draw.choice(GARBAGE) + text[place:]


def _cut(text: str, draw: random.Random) -> str:
    return text[: draw.randrange(len(text) + 1)]


def _line(text: str, draw: random.Random) -> str:
    lines = text.splitlines()
    if not lines:
        return text
    place = draw.randrange(len(lines))
    if draw.random() < 0.5:
        del lines[place]
    else:
        lines.insert(draw.randrange(len(lines) + 1), lines[place])
    return "\n".join(lines) + "\n"


def _indent(text: str, draw: random.Random) -> str:
    lines = text.splitlines()
    if lines:
        lines[draw.randrange(len(lines))] = (
            " " * draw.randrange(6) + lines[draw.randrange(len(lines))].strip()
        )
    return "\n".join(lines) + "\n"


def _word(text: str, draw: random.Random) -> str:
    words = list(re.finditer(r"[A-Za-z_]+", text))
    if not words:
        return text
    one, other = draw.choice(words), draw.choice(words)
    return text[: one.start()] + other.group() + text[one.end() :]


def _nest(text: str, draw: random.Random) -> str:
    depth = draw.choice((40, 60, 3000))
    return text + "\nx: " + "[" * depth + "]" * depth + "\n"


def _bomb(text: str, draw: random.Random) -> str:
    lines = ["b0: &b0 [1, 1]"] + [
        f"b{k}: &b{k} [*b{k - 1}, *b{k - 1}]" for k in range(1, draw.choice((5, 40)))
    ]
    return text + "\n" + "\n".join(lines) + "\n"


_TEXT_CHANGES: tuple[Callable[[str, random.Random], str], ...] = (
    _number, _number, _number, _insert, _insert, _cut, _line, _line, _indent, _word, _word, _nest, _bomb,
)  # fmt: skip


def mutate_bag(folder: Path, draw: random.Random) -> None:
    """Damage a copy of a bag: its bytes, its metadata.yaml, or messages and texts inside of sound storage."""
    files = sorted(file for file in folder.iterdir() if file.suffix in (".mcap", ".db3"))
    file, card = files[0], folder / "metadata.yaml"
    kind = draw.choice(("bytes", "bytes", "bytes", "card", "messages", "messages", "file"))
    if kind == "bytes":
        file.write_bytes(mutate_bytes(file.read_bytes(), draw))
    elif kind == "card":
        text = mutate_text(card.read_text(), draw) if draw.random() < 0.7 else None
        content = (
            mutate_bytes(card.read_bytes(), draw) if text is None else text.encode(errors="surrogatepass")
        )
        card.write_bytes(content)
    elif kind == "messages" and file.suffix == ".mcap":
        _rewrite_mcap(file, draw)
    elif kind == "messages":
        _rewrite_sqlite3(file, draw)
    else:
        draw.choice(
            (card.unlink, file.unlink, lambda: file.write_bytes(b""), lambda: file.rename(folder / "x.mcap"))
        )()


def _changed(data: bytes, draw: random.Random, share: float) -> bytes:
    return mutate_bytes(data, draw) if data and draw.random() < share else data


def _time(time: int, draw: random.Random) -> int:
    return draw.choice(EXTREMES) if draw.random() < 0.01 else time


def _rewrite_mcap(file: Path, draw: random.Random) -> None:
    """Write the file again, sound as a file, with damaged messages, definitions, texts and times."""
    target = draw.choice(("message", "message", "schema", "text", "time", "encoding"))
    with open(file, "rb") as stream:
        reader = make_reader(stream)
        messages = list(reader.iter_messages(log_time_order=False))
        texts = list(reader.iter_metadata())
    part = file.with_suffix(".part")
    with open(part, "wb") as out:
        writer = Writer(out, compression=draw.choice(list(CompressionType)), use_chunking=draw.random() < 0.8)
        writer.start(profile="ros2")
        channels: dict[int, int] = {}
        for record in texts:
            change = target == "text" and record.name == "ldcs_ros"
            values = {
                key: mutate_text(text, draw) if change and draw.random() < 0.3 else text
                for key, text in record.metadata.items()
            }
            writer.add_metadata(
                record.name, {key: text.encode(errors="replace").decode() for key, text in values.items()}
            )
        for schema, channel, message in messages:
            if channel.id not in channels:
                text = _changed(schema.data, draw, 0.5 if target == "schema" else 0.0)
                encoding = draw.choice(("cdr", "json", "")) if target == "encoding" else "cdr"
                number = writer.register_schema(schema.name, schema.encoding, text)
                channels[channel.id] = writer.register_channel(
                    channel.topic, encoding, number, channel.metadata
                )
            data = _changed(message.data, draw, 0.3 if target == "message" else 0.0)
            time = _time(message.log_time, draw) if target == "time" else message.log_time
            writer.add_message(channels[channel.id], time, data, time, message.sequence)
        writer.finish()
    part.replace(file)


def _rewrite_sqlite3(file: Path, draw: random.Random) -> None:
    """Change rows of a database that stays sound."""
    with suppress(sqlite3.Error), closing(sqlite3.connect(file)) as database:
        rows = database.execute("SELECT id, timestamp, data FROM messages").fetchall()
        for id, time, data in rows:
            new: object = _changed(data, draw, 0.1)
            if draw.random() < 0.01:
                new = draw.choice((None, "text", 5))
            moment = min(_time(time, draw), 2**63 - 1) - draw.choice((0, 0, 0, 2**63 - 1)) * (
                draw.random() < 0.01
            )
            with suppress(sqlite3.Error):
                database.execute(
                    "UPDATE messages SET timestamp = ?, data = ? WHERE id = ?", (moment, new, id)
                )
        with suppress(sqlite3.Error):
            change = draw.choice(
                (
                    "UPDATE topics SET type = 'x/msg/Y'",
                    "UPDATE topics SET serialization_format = 'json' WHERE id = 1",
                    "DELETE FROM topics WHERE id = 1",
                    "ALTER TABLE messages RENAME TO other",
                    "SELECT 1",
                    "UPDATE topics SET offered_qos_profiles = '[[[['",
                )
            )
            database.execute(change)
        database.commit()
