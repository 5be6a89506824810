"""Speed against error, measured: the loss curves, the optimizer, the fit, the online controller."""
