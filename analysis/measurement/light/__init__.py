"""Light over time: the PWM of a backlight, response time, and latency from frame to light."""
