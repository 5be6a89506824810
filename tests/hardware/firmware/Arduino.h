// Stand-ins for what the sketch of docs/power-board.md asks of Arduino, so that it runs on a computer.
#pragma once
#include <poll.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

const int INPUT = 0;

extern int pwm_now;  // what analogWrite was last given

uint32_t micros();
void delay(int milliseconds);
inline void pinMode(int, int) {}
inline int digitalRead(int) { return micros() / 100000 % 2; }  // a sync line of 5 Hz
inline void analogWrite(int, int value) { pwm_now = value; }

struct Port {
  int file;
  void begin(long) {}
  void print(const char *text);
  int availableForWrite() { return 64; }
  int available();
  int read();
};
extern Port Serial;
