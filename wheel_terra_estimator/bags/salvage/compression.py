# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Zstandard and LZ4 data unpacked as far as they reach and no further than allowed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from wheel_terra_estimator.bags.salvage import limits
from wheel_terra_estimator.bags.salvage.limits import MEGABYTE, in_words
from wheel_terra_estimator.errors import UserError

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
CODECS = ('', 'zstd', 'lz4')  # compressions of MCAP chunks that can be read; empty: none

_SLICE = 4096  # packed bytes fed at a time behind an error, so that little is lost before it


class Unpacked(NamedTuple):
    """What packed data gave; ``damage`` says in words why it is not all, empty if it is."""

    content: bytes
    damage: str


def unpack(codec: str, packed: bytes | memoryview, size: int) -> Unpacked:
    """Unpack a chunk, which may be cut or damaged, by one of `CODECS`.

    ``size``: unpacked size that the file states [byte]; 0: none. It may be damaged: how much there
    is decides, not what is stated. Nothing above `limits.unpacked` is unpacked.
    """
    most = limits.unpacked(len(packed)) if codec else limits.CHUNK
    too_large = f'a chunk is above {in_words(most)}'
    if codec not in CODECS:
        return Unpacked(b'', f'the compression {codec!r} is not known')
    if not codec:
        if len(packed) > most:
            return Unpacked(b'', too_large)
        return Unpacked(bytes(packed), '' if len(packed) == size else 'a chunk is cut off')
    whole = _all_at_once(codec, packed, size) if 0 < size <= most else None
    if whole is not None and len(whole) == size:
        return Unpacked(whole, '')
    decompressor = _decompressor(codec)
    pieces = list(_piecewise(decompressor, packed, most + 1))
    if sum(map(len, pieces)) > most:  # known before they are joined, which doubles them
        return Unpacked(b'', too_large)
    content = b''.join(pieces)
    del pieces
    if decompressor.eof and not size:
        return Unpacked(content, '')
    return Unpacked(content, f'a chunk of {size} B unpacks to {len(content)} B')


def unpack_message(packed: bytes) -> bytes:
    """Unpack a message that was packed alone; nothing comes of a damaged or too large one."""
    found = _all_at_once('zstd', packed, limits.MESSAGE)
    return b'' if found is None or len(found) > limits.MESSAGE else found


def unpack_file(path: Path, target: Path) -> str:
    """Unpack a ``.zstd`` file into another one, as far as it reaches.

    Raises UserError where it cannot be read or written, or unpacks to far more than recordings do.
    Returns why that is not all of it; empty when it is.
    """
    written = 0
    allowed = limits.work(path.stat().st_size)
    try:
        with path.open('rb') as packed, target.open('wb') as out:
            decompressor = _decompressor('zstd')
            try:
                while not decompressor.eof:
                    piece = packed.read(MEGABYTE) if decompressor.needs_input else b''
                    if decompressor.needs_input and not piece:
                        return f'{path.name} is cut off'
                    content = decompressor.decompress(piece, MEGABYTE)
                    written += len(content)
                    if written > allowed:
                        raise bomb(path)
                    out.write(content)
            except (OSError, UserError):
                raise
            except Exception as error:  # the library's own error class differs with its version
                return f'{path.name} cannot be unpacked further ({error})'
    except OSError as error:
        raise UserError(f'{path}: cannot be unpacked ({error.strerror})') from None
    return ''


def bomb(path: Path) -> UserError:
    """Return the error of a file that unpacks to far more than recordings do."""
    return UserError(
        f'{path}: unpacks to more than {limits.PACKED_SHARE} times its size; no recording does, '
        'so it is not read'
    )


def _all_at_once(codec: str, packed: bytes | memoryview, size: int) -> bytes | None:
    """Return what data unpack to, at most ``size`` bytes and one, None after an error."""
    try:
        return bytes(_decompressor(codec).decompress(bytes(packed), size + 1))
    except Exception:  # each library and version has an error class of its own
        return None


def _piecewise(decompressor: Any, packed: bytes | memoryview, size: int) -> Iterator[bytes]:
    """Yield what data unpack to until an error."""
    left = size
    for at in range(0, len(packed), _SLICE):
        piece = bytes(packed[at : at + _SLICE])
        while left > 0 and not decompressor.eof:
            try:
                content = bytes(decompressor.decompress(piece, min(left, MEGABYTE)))
            except Exception:  # see above
                return
            yield content
            left -= len(content)
            piece = b''
            if decompressor.needs_input or not content:
                break


def _decompressor(codec: str) -> Any:
    if codec == 'lz4':
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    return _zstd().ZstdDecompressor()


@cache
def _zstd() -> Any:
    try:  # the library came with rosbags
        from compression import zstd  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        from backports import zstd
    return zstd
