"""From trials to thresholds, rate limits, figures and reports."""

if (
    __name__ != "evenlight.analysis"
):  # `import analysis` in a checkout would make a second copy of every module
    raise ImportError("import it as evenlight.analysis")
