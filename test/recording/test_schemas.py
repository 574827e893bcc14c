# SPDX-License-Identifier: Apache-2.0
"""Message definitions and hashes against those of the installed packages."""

import importlib
import json
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.schemas import message_schema, type_hash


def test_each_recorded_type_has_the_hash_of_the_installed_package_and_a_text_that_defines_it():
    topics = pytest.importorskip("skydiver_utc.nodes.topics")
    types = {topic.type_name for topic in topics.TOPICS} | {
        topics.sensor_topic("any", message).type_name for message in topics.SENSOR_TYPES
    }
    for type_name in types:
        package, _, message = type_name.split("/")
        places = Path(importlib.import_module(package).__file__).parents
        described = (place / "share" / package / "msg" / f"{message}.json" for place in places)
        hashes = json.loads(next(file for file in described if file.is_file()).read_text())["type_hashes"]
        schema = message_schema(type_name)
        assert {"type_name": type_name, "hash_string": schema.type_hash} in hashes
        own = get_typestore(Stores.EMPTY)
        own.register(get_types_from_msg(schema.text, type_name))
        assert schema.type_hash == type_hash(type_name) == own.hash_rihs01(type_name)


@pytest.mark.parametrize("type_name", ["own_msgs/msg/Thing", "Odometry", "nav_msgs/Odometry", ""])
def test_a_type_of_another_origin_is_named(type_name):
    assert type_hash(type_name) == ""
    with pytest.raises(RecordingError, match=f"'{type_name}'"):
        message_schema(type_name)
