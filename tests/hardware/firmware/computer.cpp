// Runs the sketch on a computer: its serial port is an open file, its clock rolls over one second after the start.
#include <chrono>

#include "Arduino.h"
#include "Wire.h"

int pwm_now;
Port Serial;
Sensor Wire;
static uint32_t switched_on;

void setup();
void loop();

static uint32_t steady_us() {
  using namespace std::chrono;
  return (uint32_t)duration_cast<microseconds>(steady_clock::now().time_since_epoch()).count();
}

uint32_t micros() { return steady_us() - switched_on - 1000000u; }

void delay(int milliseconds) { usleep(milliseconds * 20); }  // faster than life: nobody waits for ZERO

void Port::print(const char *text) {
  for (size_t left = strlen(text); left > 0;) {
    ssize_t written = write(file, text, left);
    if (written < 0) exit(1);
    text += written;
    left -= written;
  }
}

int Port::available() {
  pollfd look = {file, POLLIN, 0};
  return poll(&look, 1, 0) > 0 && (look.revents & POLLIN);
}

int Port::read() {
  unsigned char byte;
  if (::read(file, &byte, 1) != 1) exit(0);
  return byte;
}

// Two steps of the PWM stand for what the sensor's zero and its end are tried with [counts of 2.5 uV].
static int16_t shunt_counts() {
  const float power = pwm_now ? 0.3f + 1.5f * pwm_now / 255 : 5.0f * 0.0005f;
  if (pwm_now == 1) return -300;   // a zero that is off by -7.5 mA
  if (pwm_now == 2) return 32700;  // of 32767
  return (int16_t)lroundf(power / 5.0f * 0.1f / 2.5e-6f);
}

int Sensor::requestFrom(uint8_t, uint8_t) {
  high_is_next = true;
  value = 0;
  if (number == 0x06 && micros() - last_conversion >= 664) {
    value = 0x0008;
    last_conversion = micros();
  }
  if (number == 0x01) value = shunt_counts();
  if (number == 0x02) value = (int16_t)(5.0f / 1.25e-3f);
  return 2;
}

int main(int, char **arguments) {
  switched_on = steady_us();
  Serial.file = atoi(arguments[1]);
  for (setup();; usleep(50)) loop();
}
