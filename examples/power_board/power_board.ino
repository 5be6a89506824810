#include <Arduino.h>
#include <Wire.h>

const uint8_t SENSOR = 0x40, SYNC_PIN = 2, PWM_PIN = 9;
const float SHUNT = 0.1f;                                  // ohm
const int PWM_STEPS = 255;                                 // of analogWrite
const uint32_t SLOWEST = 1000000, FASTEST = 2000;          // us between samples
const float UW_PER_COUNT = 1.25e-3f * 2.5e-6f / SHUNT * 1e6f;  // bus LSB 1.25 mV, shunt LSB 2.5 uV

char heard[64];
uint8_t length = 0;
uint64_t high_word = 0;  // of the clock: micros() has 32 bits
uint32_t last_micros = 0;

bool sampling = false;
uint32_t period, due;
uint16_t sequence;
float sum_uw;
uint16_t conversions;
uint8_t overload;
int16_t zero_counts = 0;
int pwm_step = PWM_STEPS;

uint16_t crc16(const char *text) {
  uint16_t crc = 0xFFFF;
  for (; *text; text++) {
    crc ^= (uint16_t)(uint8_t)*text << 8;
    for (uint8_t bit = 0; bit < 8; bit++) crc = crc & 0x8000 ? (uint16_t)(crc << 1) ^ 0x1021 : crc << 1;
  }
  return crc;
}

void send_line(const char *body) {
  char end[8];
  snprintf(end, sizeof end, "*%04X\n", (unsigned)crc16(body));
  Serial.print(body);
  Serial.print(end);
}

uint64_t clock_us() {  // asked for in every round of loop(), so no rollover is missed
  uint32_t now = micros();
  if (now < last_micros) high_word += 1ULL << 32;
  last_micros = now;
  return high_word + now;
}

bool read_register(uint8_t number, int16_t *value) {
  Wire.beginTransmission(SENSOR);
  Wire.write(number);
  if (Wire.endTransmission() != 0 || Wire.requestFrom(SENSOR, (uint8_t)2) != 2) return false;
  uint16_t high = (uint8_t)Wire.read();  // an int of 16 bits has no room for its highest bit
  *value = (int16_t)(high << 8 | (uint8_t)Wire.read());
  return true;
}

void take_conversion() {
  int16_t state, shunt, bus;
  if (!read_register(0x06, &state)) { sampling = false; send_line("E 6 sensor_lost"); return; }
  if (!(state & 0x0008)) return;  // no new conversion; reading the register cleared the bit
  if (!read_register(0x01, &shunt) || !read_register(0x02, &bus)) return;
  if (shunt == INT16_MAX || shunt == INT16_MIN) overload |= 2;
  if (bus >= 0x7080) overload |= 4;  // 36 V
  sum_uw += ((float)shunt - zero_counts) * bus * UW_PER_COUNT;  // in 16 bits the difference would wrap
  conversions++;
}

void send_sample(uint32_t now) {
  char body[40];
  uint8_t flags = overload | (digitalRead(SYNC_PIN) ? 1 : 0);
  snprintf(body, sizeof body, "P %u %lu %ld %X", (unsigned)sequence, (unsigned long)now,
           (long)lroundf(sum_uw / conversions), (unsigned)flags);
  send_line(body);
}

void sample() {
  take_conversion();
  uint32_t now = (uint32_t)clock_us();
  if (!sampling || (int32_t)(now - due) < 0) return;
  // A sample without a conversion, or that the port has no room for, is not sent: its number is missing.
  if (conversions && Serial.availableForWrite() >= 36) send_sample(now);
  sequence++;
  due += period;
  sum_uw = 0; conversions = 0; overload = 0;
}

void reply(const char *kind, long tag, const char *text) {
  char body[220];
  snprintf(body, sizeof body, "%s %ld %s", kind, tag, text);
  send_line(body);
}

void start(long tag, const char *argument) {
  char text[32];
  if (sampling) { reply("ERR", tag, "5 sampling"); return; }
  double rate = atof(argument);
  if (rate <= 0) { reply("ERR", tag, "3 number_missing"); return; }
  double wanted = 1e6 / rate + 0.5;
  if (wanted < FASTEST || wanted > SLOWEST + 1) { reply("ERR", tag, "4 out_of_range"); return; }
  period = (uint32_t)wanted;
  snprintf(text, sizeof text, "START %lu", (unsigned long)period);
  reply("OK", tag, text);
  sequence = 0; sum_uw = 0; conversions = 0; overload = 0;
  due = (uint32_t)clock_us() + period;
  sampling = true;
}

void zero(long tag) {
  char text[32];
  int16_t shunt;
  long sum = 0;
  if (sampling) { reply("ERR", tag, "5 sampling"); return; }
  for (int i = 0; i < 256; i++) {
    if (!read_register(0x01, &shunt)) { reply("ERR", tag, "6 sensor_lost"); return; }
    sum += shunt;
    delay(2);
  }
  long mean = sum / 256;
  if (labs(mean) * 2.5e-6f / SHUNT > 0.010f) { reply("ERR", tag, "8 not_zero"); return; }
  zero_counts = (int16_t)mean;
  snprintf(text, sizeof text, "ZERO %ld", lroundf(mean * 2.5f / SHUNT));
  reply("OK", tag, text);
}

void backlight(long tag, const char *argument) {
  char text[16];
  long step = strtol(argument, NULL, 10);  // not atoi: in an int of 16 bits 65536 is 0
  if (*argument < '0' || *argument > '9') { reply("ERR", tag, "3 number_missing"); return; }
  if (step > PWM_STEPS) { reply("ERR", tag, "4 out_of_range"); return; }
  pwm_step = (int)step;
  analogWrite(PWM_PIN, pwm_step);
  snprintf(text, sizeof text, "B %d", pwm_step);
  reply("OK", tag, text);
}

void obey(char *line) {
  char text[64];
  char *star = strrchr(line, '*');
  if (!star) { reply("ERR", 0, "1 checksum"); return; }
  *star = 0;
  if (strlen(star + 1) < 4 || strtoul(star + 1, NULL, 16) != crc16(line)) { reply("ERR", 0, "1 checksum"); return; }
  char *command;
  long tag = strtol(line, &command, 10);
  while (*command == ' ') command++;
  if (!strcmp(command, "ID?")) {
    reply("OK", tag, "ID? evenlight-power-board protocol=1 chip=INA226 serial=1 firmware=1.0 "
                     "max_rate_hz=500 line=uart max_power_uw=4096000 pwm_steps=255");
  } else if (!strncmp(command, "START", 5)) {
    start(tag, command + 5);
  } else if (!strcmp(command, "STOP")) {
    sampling = false;
    reply("OK", tag, "STOP");
  } else if (!strcmp(command, "CLOCK?")) {
    uint64_t now = clock_us();
    // printf of small libraries has no 64 bits: millions, and the rest with its zeros
    snprintf(text, sizeof text, "CLOCK? %lu%06lu", (unsigned long)(now / 1000000), (unsigned long)(now % 1000000));
    reply("OK", tag, text);
  } else if (!strcmp(command, "ZERO")) {
    zero(tag);
  } else if (!strcmp(command, "B?")) {
    snprintf(text, sizeof text, "B? %d", pwm_step);
    reply("OK", tag, text);
  } else if (!strncmp(command, "B ", 2)) {
    backlight(tag, command + 2);
  } else {
    reply("ERR", tag, "2 unknown_command");
  }
}

void setup() {
  Serial.begin(115200);
  Wire.begin();
  Wire.setClock(400000);
  pinMode(SYNC_PIN, INPUT);
  analogWrite(PWM_PIN, pwm_step);
  Wire.beginTransmission(SENSOR);
  Wire.write(0x00);  // configuration: no averaging, 332 us for each of bus and shunt, continuously
  Wire.write(0x40);
  Wire.write(0x97);
  Wire.endTransmission();
}

void loop() {
  clock_us();
  if (sampling) sample();
  while (Serial.available()) {
    char c = Serial.read();
    if (c == '\n') { heard[length] = 0; length = 0; obey(heard); }
    else if (length < sizeof heard - 1) heard[length++] = c;
  }
}
