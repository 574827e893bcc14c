"""`player_node`: the node of bag_player.py as a process."""

import sys
from collections.abc import Sequence

from skydiver_utc.nodes.process import run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    return run("player", arguments)


if __name__ == "__main__":
    sys.exit(main())
