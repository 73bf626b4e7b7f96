"""The bytes of a text file from a given line on, checked as they pass.

Wrong encoding, zero bytes and runaway lines are found; lines may end as Unix, Windows or the old
Macintosh ended them.
"""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterator
from pathlib import Path

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.binary_kinds import binary_kind
from testbench.formats.tables.monitor import written_in

LONGEST_LINE = 1_000_000
"""Bytes; a longer one is no row of a table."""
FIRST, DOUBLINGS = 1 << 18, 3
"""Bytes that are read at first, and so often twice as many as before: who looks at the beginning
of a file alone reads little.
"""
BLOCK = FIRST << DOUBLINGS
"""Bytes that are read at once from then on."""
_TOO_LONG = f"a line is longer than {LONGEST_LINE // 1_000_000} MB; this is not a table of samples"
SNIFFED = 4096
"""Bytes from which the encoding of a file without a mark is told."""


class LineStream(io.RawIOBase):
    """A binary file object over the rows of a text file, always in UTF-8; of lines that a serial
    monitor wrote, the rows in them.

    Args:
        file: To read.
        encoding: Of the file.
        skip: Lines to leave out at the beginning.
        squeeze: Turn runs of blanks into single spaces, and drop those at the ends of lines.
    """

    def __init__(self, file: Path, encoding: str, skip: int = 0, squeeze: bool = False):
        super().__init__()
        self._path, self._encoding, self._squeeze = file, encoding, squeeze
        self._decoder = codecs.getincrementaldecoder(encoding)()
        self._ascii_like = codecs.lookup(encoding).name in {
            "utf-8",
            "utf-8-sig",
            "iso8859-1",
            "cp1252",
            "ascii",
            "iso8859-15",
        }
        self._clean = True  # the decoder holds no part of a character
        self._written = written_in(file, encoding)
        self._file = file.open("rb")
        self._pieces, self._out, self._held, self._ended = 0, b"", b"", False
        self._returns_only: bool | None = None  # whether lines end in CR alone, once that is seen
        self._skip(skip)

    def readable(self) -> bool:
        return True

    def close(self) -> None:
        self._file.close()
        super().close()

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        while not self._out and not self._ended:
            self._out = self._next()
        count = min(len(buffer), len(self._out))
        buffer[:count] = self._out[:count]
        self._out = self._out[count:]
        return count

    def read(self, size: int = -1) -> bytes:
        if size < 0:
            return b"".join(iter(lambda: self.read(BLOCK), b""))
        while not self._out and not self._ended:
            self._out = self._next()
        piece, self._out = self._out[:size], self._out[size:]
        return piece

    def lines(self) -> Iterator[str]:
        """The lines, without their ends."""
        held = b""
        while block := self.read(BLOCK):
            *whole, held = (held + block).split(b"\n")
            for line in whole:
                yield line.decode("utf-8").rstrip("\r")
            if len(held) > LONGEST_LINE:
                raise self._refuse(_TOO_LONG)
        if held:
            yield held.decode("utf-8").rstrip("\r")

    def blocks(self) -> Iterator[bytes]:
        """Whole lines in pieces of about `BLOCK` bytes, the first ones shorter; pieces of nothing
        but blanks are left out.
        """
        held = b""
        while not self._ended or self._out:
            block, self._out = self._out or self._next(), b""
            end = block.rfind(b"\n") + 1
            if end:
                text = b"".join((held, memoryview(block)[:end]))
                held = block[end:]
                if not text.isspace():
                    yield text
            else:
                held += block
            if len(held) > LONGEST_LINE:
                raise self._refuse(_TOO_LONG)
        if held and not held.isspace():
            yield held

    def _skip(self, count: int) -> None:
        for _ in range(count):
            while b"\n" not in self._out and not self._ended:
                self._out += self._next()
                if len(self._out) > LONGEST_LINE + 2 * BLOCK:
                    raise self._refuse(
                        "a line of the header is too long; this is not a table of samples"
                    )
            _, _, self._out = self._out.partition(b"\n")

    def _next(self) -> bytes:
        """The next piece in UTF-8; empty at the end, or when a piece holds nothing but blanks."""
        raw = self._file.read(FIRST << min(self._pieces, DOUBLINGS))
        if not raw:
            self._ended = True
            self._decode(b"", final=True)
            result, self._held = self._held, b""
            return self._plain(result)
        text = self._decode(raw)
        if b"\0" in text:
            raise self._refuse(
                "holds zero bytes: this is not text", self._line_of(text, text.index(b"\0"))
            )
        if self._returns_only is None:
            self._returns_only = b"\r" in text and b"\n" not in text
        if self._returns_only:
            text = text.replace(b"\r", b"\n")
        self._pieces += 1
        if not self._squeeze and self._written is None:
            return text
        whole, newline, rest = (self._held + text).rpartition(b"\n")
        self._held = rest
        if len(rest) > LONGEST_LINE:
            raise self._refuse(_TOO_LONG)
        return self._plain(whole + newline)

    def _decode(self, raw: bytes, final: bool = False) -> bytes:
        if self._ascii_like and self._clean and raw.isascii():
            return raw
        try:
            text = self._decoder.decode(raw, final)
        except UnicodeDecodeError as error:
            line = self._line_of(error.object, error.start)
            shown = " ".join(
                f"0x{byte:02X}" for byte in error.object[error.start : error.start + 3]
            )
            raise self._refuse(
                f"the bytes {shown} are not {self._encoding} text; save the file in one encoding, "
                "or state which it is (--encoding cp1252 is usual on Windows)",
                line,
            ) from None
        state = self._decoder.getstate()
        self._clean = not state[0] and self._encoding != "utf-8-sig"
        return text.encode("utf-8")

    def _plain(self, text: bytes) -> bytes:
        """Whole lines as rows."""
        text = text if self._written is None else self._written.plain(text)
        return self._squeezed(text) if self._squeeze else text

    @staticmethod
    def _squeezed(text: bytes) -> bytes:
        text = re.sub(rb"[ \t\r]+", b" ", text)
        text = text.replace(b"\n ", b"\n").replace(b" \n", b"\n")
        return text[1:] if text[:1] == b" " else text

    def _line_of(self, text: bytes, position: int) -> int:
        """The line of a byte of the piece at hand; those before it are counted once more, here
        alone.
        """
        with LineStream(self._path, self._encoding) as again:
            before = sum(again._next().count(b"\n") for _ in range(self._pieces))
        return before + text.count(b"\n", 0, position) + 1

    def _refuse(self, message: str, line: int | None = None) -> FileProblems:
        return FileProblems(self._path, [Problem(message, line=line)])


def check_readable(file: Path) -> None:
    """Refuse what cannot be a text file.

    Raises:
        FileProblems: Missing, a folder, unreadable, empty, or of a known binary kind.
    """

    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    if not file.exists():
        raise refuse("the file does not exist")
    if not file.is_file():
        raise refuse("this is not a file")
    try:
        with file.open("rb") as stream:
            empty = not stream.read(1)
        kind = None if empty else binary_kind(file)
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}") from None
    if empty:
        raise refuse("the file is empty")
    if kind is not None:
        raise refuse(
            f"this is {kind.name}, not a text file" + (f"; {kind.advice}" if kind.advice else "")
        )


def encoding_of(file: Path, stated: str | None = None) -> str:
    """The encoding of a text file, by the name that Python knows it by.

    Args:
        file: That exists.
        stated: What a person says; "utf-16" leaves the order of the bytes open.

    Returns:
        As stated; else as the mark says; UTF-16 without a mark where every other byte is zero, as
        it is in titles and numbers; else UTF-8.
    """
    with file.open("rb") as stream:
        head = stream.read(SNIFFED)
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        marked = "utf-16"
    else:
        marked = "utf-8-sig" if head.startswith(codecs.BOM_UTF8) else ""
    if stated is not None and stated != "utf-16":
        with_mark = {("utf-8", "utf-8-sig"), ("utf-16-le", "utf-16"), ("utf-16-be", "utf-16")}
        return marked if (stated, marked) in with_mark else stated
    if stated is None and marked:
        return marked
    order = _byte_order(head)
    if stated == "utf-16":
        return marked if marked == "utf-16" else order or "utf-16-le"
    return order or "utf-8"


def _byte_order(head: bytes) -> str | None:
    """The UTF-16 that bytes without a mark are, None where they are none."""
    half = len(head) // 2
    if half < 2:
        return None
    first, second = head[: 2 * half : 2].count(0) / half, head[1 : 2 * half : 2].count(0) / half
    if second > 0.7 and first < 0.1:
        return "utf-16-le"
    return "utf-16-be" if first > 0.7 and second < 0.1 else None
