# SPDX-License-Identifier: Apache-2.0
"""The namespace of the plant in a bag."""

from collections.abc import Iterable

from skydiver_utc.errors import RecordingError

DEFAULT_NAMESPACE = "/skydiver"


def namespace_of(topic_names: Iterable[str], name: str = "scenario") -> str:
    """The namespace of the recorded topic with this relative name; `DEFAULT_NAMESPACE` if there is none.

    Topics of this name in several namespaces raise `RecordingError`: a run folder holds one plant.
    """
    ending = f"/{name}"
    found = sorted(topic.removesuffix(ending) for topic in topic_names if topic.endswith(ending))
    if len(found) > 1:
        raise RecordingError(
            f"The recording holds several namespaces ({', '.join(found)}): record each into its own bag, as"
            " `skydiver-utc run` does."
        )
    return found[0] if found else DEFAULT_NAMESPACE
