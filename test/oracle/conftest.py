"""Makes `import paper_utc` and `import aerodynamics` work under every import mode of pytest."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = str(Path(__file__).parent)
if HERE not in sys.path:
    sys.path.insert(0, HERE)
