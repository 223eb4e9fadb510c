"""Damage to a file of finished results, and what each reader says of it in a process of its own.

A case ends well if each answer is the sound results' answer or a part of it, one sentence, or names the damage.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

SERVER = Path(__file__).with_name("reader_server.py")
#: Characters of the longest message.
LONGEST = 400

Question = Sequence[str]


def flip_bit(path: Path, bit: int) -> None:
    """Change one bit of a file."""
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


class Readers:
    """Readers of results in a folder, each time in a fresh process with a time limit."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._answers = folder.with_name(f"{folder.name}.answers")
        self._server = subprocess.Popen(
            [sys.executable, str(SERVER)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": str(folder / "src")},
        )  # fmt: skip
        self._sound: dict[Question, dict[str, Any]] = {}

    def close(self) -> None:
        """End the process."""
        self._server.communicate()

    def ask(self, *questions: Question, **limits: object) -> list[dict[str, Any]]:
        """Answers to ``questions``; a crash or a process that takes too long is an AssertionError."""
        request = {"folder": str(self.folder), "questions": questions, "place": str(self._answers), **limits}
        self._server.stdin.write(json.dumps(request) + "\n")
        self._server.stdin.flush()
        ended = int(self._server.stdout.readline())
        assert ended == 0, f"signal {-ended}" if ended < 0 else f"status {ended}"
        return json.loads(self._answers.read_text(encoding="utf-8"))

    def learn(self, questions: Sequence[Question]) -> None:
        """Keep the answers about the sound results, with which others are compared."""
        new = [question for question in map(tuple, questions) if question not in self._sound]
        if new:
            for question, answer in zip(new, self.ask(*new, warm=True), strict=True):
                assert answer["status"] == 0, answer
                self._sound[question] = answer

    def end(self, name: str, questions: Sequence[Question]) -> str:
        """End of a case with file ``name`` damaged: harmless or found; anything else is an AssertionError."""
        ends = {self._end_of(name, tuple(q), answer) for q, answer in zip(questions, self.ask(*questions), strict=True)}
        return "found" if "found" in ends else "harmless"

    def _end_of(self, name: str, question: Question, answer: dict[str, Any]) -> str:
        told, message = answer["out"], answer["message"]
        assert answer["status"] in {0, 1, 2}, f"{question}: {message}"
        if question[:2] == ("nearharmonic", "verify"):
            assert answer["status"], f"{question} finds nothing"
            assert name in told + message, f"{question} names something else: {told}{message}"
            return "found"
        if answer["status"] == 1 and name in told:
            return "found"
        if answer["status"]:
            assert message.count("\n") == 1, f"{question}: {message}"
            assert len(message) <= LONGEST, f"{question}: {message}"
            return "found"
        if told == self._sound[question]["out"]:
            return "harmless"
        less = set(told.splitlines()) < set(self._sound[question]["out"].splitlines())
        assert less or "damaged" in told or "compiled again" in told, f"{question}: another answer"
        return "found"


@contextmanager
def damaged(path: Path, damage: Callable[[Path], object]) -> Iterator[None]:
    """``path`` after ``damage``, and as it was when the block has ended."""
    content, times = path.read_bytes(), path.stat()
    try:
        damage(path)
        yield
    finally:
        if path.is_dir():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        path.write_bytes(content)
        path.chmod(times.st_mode & 0o7777)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
