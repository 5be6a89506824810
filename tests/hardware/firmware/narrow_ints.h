// Makes the sketch's int as narrow as on an 8-bit AVR, where it has 16 bits: a difference of two int16_t, and
// whatever is kept in an int, wraps there. On this computer both would be widened to 32 bits, and hide it.
// What is no variable (a sum of two literals, a shift of an uint8_t) keeps its 32 bits here.
#pragma once
#include "Arduino.h"
#include "Wire.h"

class Narrow {
 public:
  Narrow() = default;
  Narrow(int number) : number((short)number) {}
  operator short() const { return number; }
  Narrow operator+(Narrow other) const { return number + other.number; }
  Narrow operator-(Narrow other) const { return number - other.number; }
  Narrow operator*(Narrow other) const { return number * other.number; }

 private:
  short number;
};

#define int16_t Narrow
#define int short
