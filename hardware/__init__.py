"""Devices: window, keys and backlight of a session, their simulations, and the rig that names them."""

# `import hardware` in a checkout would make a second copy of every module.
if __name__ != "evenlight.hardware":
    raise ImportError("import it as evenlight.hardware")
