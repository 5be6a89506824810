"""What runs in the tree of `runtime-tree.sh` is collected there; what builds the tree, outside of it."""

import os
from pathlib import Path

IN_TREE = "EVENLIGHT_IN_RUNTIME_TREE" in os.environ
OUTSIDE = Path(__file__).parent / "test_runtime_tree.py"


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Collect what runs in the tree there only, and what runs outside of it only outside."""
    is_test = collection_path.name.startswith("test_")
    return True if is_test and (collection_path == OUTSIDE) == IN_TREE else None
