"""Sessions with participants, real or simulated: designs, observers, tasks."""

if (
    __name__ != "evenlight.experiments"
):  # `import experiments` in a checkout would make a second copy of every module
    raise ImportError("import it as evenlight.experiments")
