"""Whose recording it is: the namespace of the one skydiver in a bag."""

from collections.abc import Iterable

from skydiver_utc.recording.errors import RecordingError

DEFAULT_NAMESPACE = "/skydiver"


def namespace_of(topic_names: Iterable[str], name: str = "scenario") -> str:
    """The namespace in which a topic of this name was recorded; the default one where there is none.

    Several raise `RecordingError`: a run has one skydiver.
    """
    ending = f"/{name}"
    found = sorted(topic.removesuffix(ending) for topic in topic_names if topic.endswith(ending))
    if len(found) > 1:
        raise RecordingError(
            f"The recording holds several skydivers ({', '.join(found)}): record each into a bag of its own, as"
            " `skydiver-utc run` does."
        )
    return found[0] if found else DEFAULT_NAMESPACE
