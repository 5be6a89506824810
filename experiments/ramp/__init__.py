"""The ramp experiment (Section 3.4): its plan, placement, conducting and simulated participants."""
