# SPDX-License-Identifier: Apache-2.0
"""A disk for recordings that is full, or does not accept writes for a while."""

import threading
from pathlib import Path
from typing import Any

import pytest


class Disk:
    """Holds every .mcap file created from now on; `room` in bytes, None: unlimited; set `blocked` to stall it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int | None = None) -> None:
        self.room = room
        self.blocked = False
        self._poll = threading.Event()
        ordinary = Path.open

        def open_file(path: Path, mode: str = "r", *arguments: Any, **options: Any) -> Any:
            file = ordinary(path, mode, *arguments, **options)
            return _File(file, self) if path.suffix == ".mcap" and mode == "xb" else file

        monkeypatch.setattr(Path, "open", open_file)

    def write(self, size: int) -> None:
        """Wait while blocked, and raise the error of a full disk."""
        while self.blocked:
            self._poll.wait(0.01)
        if self.room is not None:
            if self.room <= 0:
                raise OSError(28, "No space left on device")
            self.room -= size  # the write that fills it is whole: how large a chunk is depends on the machine


class _File:
    def __init__(self, file: Any, disk: Disk) -> None:
        self._file, self._disk = file, disk

    def write(self, data: bytes) -> int:
        self._disk.write(len(data))
        return int(self._file.write(data))

    def __enter__(self) -> "_File":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)
