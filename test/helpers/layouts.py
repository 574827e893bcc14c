# SPDX-License-Identifier: Apache-2.0
"""The layouts of `config/layouts` beside a recorded run of the skydiver."""

import json
import re
from functools import reduce
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from package_files import ROOT

LAYOUTS = ROOT / "config" / "layouts"


def assert_layouts_fit(folder: Path) -> None:
    """Every topic and field is in the bag; a series of a named value is labelled with its name."""
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        bag: dict[str, Any] = {}
        frames: set[str] = set()
        for _, channel, _, message in reader.iter_decoded_messages():
            bag[channel.topic] = message
            frames |= {each.child_frame_id for each in transforms(message)}
    panels = json.loads((LAYOUTS / "foxglove.json").read_text())["configById"]
    scene = panels.pop("3D!1")
    assert set(scene["topics"]) | {layer["topic"] for layer in scene["layers"].values()} <= set(bag)
    assert scene["followTf"] in frames
    series = [one for panel in panels.values() for one in panel["paths"]]
    for one in series:
        topic, *fields = one["value"].split(".")
        found = field_of(bag[topic], fields)
        assert isinstance(found, float)
        if entry := re.fullmatch(r"position\[(\d+)\]", fields[-1]):
            assert bag[topic].name[int(entry[1])] == one["label"]
    curves = ElementTree.parse(LAYOUTS / "plotjuggler.xml").iter("curve")
    names = [curve.attrib["name"] for curve in curves]
    assert len(names) == len(series)
    for name in names:
        topic = max((topic for topic in bag if name.startswith(f"{topic}/")), key=len)
        fields = name.removeprefix(f"{topic}/").split("/")
        named = [[each, "position"] for each in getattr(bag[topic], "name", [])]  # of a JointState
        assert fields in named or isinstance(field_of(bag[topic], fields), float)


def transforms(message: Any) -> list[Any]:
    """The transforms of a message: a list on `/tf`, a single one on `transforms`."""
    return getattr(message, "transforms", [message] if hasattr(message, "transform") else [])


def field_of(message: Any, fields: list[str]) -> Any:
    """A nested field; one entry of it where the last name ends with [i]."""

    def get(value: Any, field: str) -> Any:
        name, _, index = field.rstrip("]").partition("[")
        found = getattr(value, name)
        return found[int(index)] if index else found

    return reduce(get, fields, message)
