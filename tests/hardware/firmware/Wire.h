// An INA226 with a panel of 0.3 W + 1.5 W b at 5 V, b the PWM's share; dark, it takes 0.5 mA.
#pragma once
#include "Arduino.h"

struct Sensor {
  uint8_t number;
  int16_t value;
  bool names_register, high_is_next;
  uint32_t last_conversion;
  void begin() {}
  void setClock(long) {}
  void beginTransmission(uint8_t) { names_register = true; }
  void write(uint8_t byte) {
    if (names_register) number = byte;
    names_register = false;
  }
  int endTransmission() { return 0; }
  int requestFrom(uint8_t, uint8_t);
  uint8_t read() {
    const bool is_high = high_is_next;
    high_is_next = false;
    return (uint8_t)(is_high ? (uint16_t)value >> 8 : value);
  }
};
extern Sensor Wire;
