"""The online controller of Section 6: PID, power budget, gains and their margins."""
