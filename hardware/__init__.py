"""Devices: window, keys and backlight of a session, their simulations, and the rig that names them."""

if (
    __name__ != "evenlight.hardware"
):  # `import hardware` in a checkout would make a second copy of every module
    raise ImportError("import it as evenlight.hardware")
