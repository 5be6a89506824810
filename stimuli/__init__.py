"""What is shown: video sources, built-in sequences, luminance ramps."""

if __name__ != "evenlight.stimuli":  # a second copy of every module would come with the other name
    raise ImportError("import it as evenlight.stimuli")
