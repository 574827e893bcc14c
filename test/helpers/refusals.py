# SPDX-License-Identifier: Apache-2.0
"""What is refused, with an error that people can read."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from skydiver_utc.errors import InputError, ParameterError, RecordingError


def assert_refused(
    words: str | Sequence[str],
    call: Callable[..., Any],
    *arguments: Any,
    kind: type[InputError] = ParameterError,
    **settings: Any,
) -> str:
    """The call raises this error with one line, of a recording with one sentence, that has all these words."""
    with pytest.raises(kind) as caught:
        call(*arguments, **settings)
    message = str(caught.value)
    assert "\n" not in message
    assert kind is not RecordingError or not re.search(r"[.!?] [A-Z]", message), message
    assert [word for word in ([words] if isinstance(words, str) else words) if word not in message] == []
    return message
