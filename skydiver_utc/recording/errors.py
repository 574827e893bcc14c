# SPDX-License-Identifier: Apache-2.0
"""The one error of this room."""


class RecordingError(Exception):
    """A bag cannot be written or read; the text is one sentence: what is wrong and what to do."""
