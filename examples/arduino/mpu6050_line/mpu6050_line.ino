/*
 * MPU6050 on any Arduino-compatible board, as lines of text for `testbench record --serial PORT:mpu6050`.
 *
 * Wiring: VCC and GND as the breakout wants (GY-521: 5 V or 3.3 V), SDA and SCL to the board's I2C pins, AD0 open or to GND
 * (address 0x68). No library but Wire is needed.
 *
 * Protocol, at 230400 baud:
 *   the board waits; "s" starts the stream and sets the counter to 0, "x" stops it;
 *   each sample is one line   $count,micros,ax,ay,az,gx,gy,gz,temperature*CC   that ends with CR LF:
 *     count        runs from 0 to 65535 and wraps: lost lines are seen
 *     micros       time of the reading, 32 bits of microseconds: wraps after 71.6 minutes
 *     ax..az       raw counts, 16384 to the g (+-2 g)
 *     gx..gz       raw counts, 131 to the deg/s (+-250 deg/s)
 *     temperature  raw counts, degC = counts / 340 + 36.53
 *     CC           two hexadecimal digits: exclusive or of all characters between $ and *
 *   lines that begin with # are remarks.
 * The format file is testbench/drivers/imus/presets/mpu6050.yaml. Change RATE_HZ here and rate_hz there together.
 *
 * The sensor's own filter is set to 94 Hz (accelerometer) and 98 Hz (gyroscope), below half of 200 Hz; it delays readings by
 * about 3 ms (register map RM-MPU-6000A, register 26). Raw counts are sent because decimals cost digits or time.
 */

#include <Wire.h>

const uint8_t ADDRESS = 0x68;
const uint16_t RATE_HZ = 200;
const uint32_t PERIOD_US = 1000000UL / RATE_HZ;
const uint32_t BAUD_RATE = 230400;

bool streaming = false;
uint16_t count = 0;
uint32_t due_us = 0;
char line[96];

void writeRegister(uint8_t number, uint8_t value) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(number);
  Wire.write(value);
  Wire.endTransmission();
}

// All 14 bytes of one sample in one transfer, so that they belong together; false if the sensor did not answer.
bool readSample(int16_t values[7]) {
  Wire.beginTransmission(ADDRESS);
  Wire.write((uint8_t)0x3B);  // ACCEL_XOUT_H
  if (Wire.endTransmission(false) != 0) return false;
  if (Wire.requestFrom(ADDRESS, (uint8_t)14) != 14) return false;
  for (uint8_t i = 0; i < 7; i++) {
    uint16_t high = Wire.read();
    uint16_t low = Wire.read();
    values[i] = (int16_t)((high << 8) | low);
  }
  return true;
}

void sendSample(uint32_t time_us, const int16_t v[7]) {
  // The sensor's order is acceleration, temperature, rate.
  int length = snprintf(line, sizeof(line) - 8, "$%u,%lu,%d,%d,%d,%d,%d,%d,%d", (unsigned)count, (unsigned long)time_us,
                        v[0], v[1], v[2], v[4], v[5], v[6], v[3]);
  uint8_t check = 0;
  for (int i = 1; i < length; i++) check ^= (uint8_t)line[i];
  snprintf(line + length, 8, "*%02X\r\n", (unsigned)check);
  Serial.print(line);
}

void obey() {
  while (Serial.available() > 0) {
    char command = (char)Serial.read();
    if (command == 's') {
      streaming = true;
      count = 0;
      due_us = micros();
    } else if (command == 'x') {
      streaming = false;
    }
  }
}

void setup() {
  Serial.begin(BAUD_RATE);
  Wire.begin();
  Wire.setClock(400000);
  writeRegister(0x6B, 0x01);  // PWR_MGMT_1: awake, clock of the x gyroscope
  writeRegister(0x1A, 0x02);  // CONFIG: low pass of 94 / 98 Hz
  writeRegister(0x1B, 0x00);  // GYRO_CONFIG: +-250 deg/s
  writeRegister(0x1C, 0x00);  // ACCEL_CONFIG: +-2 g
  writeRegister(0x19, (uint8_t)(1000 / RATE_HZ - 1));  // SMPLRT_DIV: of 1 kHz
  Serial.print(F("# mpu6050_line, 's' starts, 'x' stops\r\n"));
}

void loop() {
  obey();
  if (!streaming || (int32_t)(micros() - due_us) < 0) return;
  due_us += PERIOD_US;  // absolute times, so that the rate does not drift with the work
  int16_t values[7];
  uint32_t time_us = micros();
  if (readSample(values)) {
    sendSample(time_us, values);
  } else {
    Serial.print(F("# the sensor does not answer\r\n"));
  }
  count++;
}
