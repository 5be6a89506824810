"""Scripts of the folder `examples` as modules."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType


def example_script(name: str) -> ModuleType:
    """Return a script as a module; it is run once."""
    if name not in sys.modules:
        path = Path(__file__).parents[2] / "examples" / f"{name}.py"
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]
