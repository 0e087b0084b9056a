// A paddle of the Hapkit's kind: a lever with a motor and an analog position sensor, two analog
// inputs, a button and a lamp. Change the pins and describe() to what your board has.
//
// Without a command the motor is off: at the start, after a hello, and once the watchdog of the last
// command is over. See ../../FRAMES.md.

#include "rtpm_frames.h"

namespace {

const uint32_t kSpeedBaud = 115200;  // The driver's word 'speed='.

const uint8_t kPositionPin = A2;
const uint8_t kGripPin = A3;
const uint8_t kLightPin = A4;
const uint8_t kButtonPin = 2;  // To ground.
const uint8_t kMotorPin = 5;
const uint8_t kDirectionPin = 8;
const uint8_t kLampPin = 9;

const float kRadPerStep = 0.0015f;  // Of the analog converter; the driver calibrates the zero.
const float kMiddleSteps = 512;
const float kEffortMax = 0.125f;     // In newton metre, at full duty.
const float kVelocityFilter = 0.2f;  // Share of the newest difference.

float clamp(float value, float low, float high) {
  return value < low ? low : value > high ? high : value;
}

class Paddle : public rtpm_board::Board {
 public:
  Paddle() : Board(1, 1) {}

  // Reads the position, for a velocity at even times.
  void sense(uint32_t now_us) {
    const uint32_t elapsed_us = now_us - sensed_at_us_;
    if (elapsed_us < 1000) return;
    sensed_at_us_ = now_us;
    const float position = kRadPerStep * (analogRead(kPositionPin) - kMiddleSteps);
    const float velocity = (position - position_) / (1e-6f * elapsed_us);
    if (has_position_) velocity_ += kVelocityFilter * (velocity - velocity_);
    position_ = position;
    has_position_ = true;
  }

 private:
  void describe(rtpm_board::Writer& writer) override {
    writer.text("RTPM paddle");
    writer.text("");  // Serial number: give each board its own, or rely on the USB interface's.
    writer.u8(1);     // Joints: name, unit (0 rad, 1 m), range, greatest effort.
    writer.text("paddle");
    writer.u8(0);
    writer.number(-0.75f);
    writer.number(0.75f);
    writer.number(kEffortMax);
    writer.u8(2);  // Analogs: name, unit, range.
    describe_analog(writer, "grip");
    describe_analog(writer, "light");
    writer.u8(1);  // Buttons: name.
    writer.text("button");
    writer.u8(1);  // Outputs: name, unit, range, safe value.
    describe_analog(writer, "lamp");
    writer.number(0);
  }
  static void describe_analog(rtpm_board::Writer& writer, const char* name) {
    writer.text(name);
    writer.text("1");
    writer.number(0);
    writer.number(1);
  }
  uint16_t rate_hz() const override { return 500; }

  void apply() override {
    applied_ = clamp(effort(0), -kEffortMax, kEffortMax);
    lamp_ = clamp(output(0), 0, 1);
    digitalWrite(kDirectionPin, applied_ < 0 ? LOW : HIGH);
    const float magnitude = applied_ < 0 ? -applied_ : applied_;
    analogWrite(kMotorPin, static_cast<int>(255 * magnitude / kEffortMax));
    analogWrite(kLampPin, static_cast<int>(255 * lamp_));
  }
  bool is_saturated() const override { return applied_ != effort(0); }
  float safe_output(uint8_t) const override { return 0; }

  void measure(rtpm_board::Writer& writer) override {
    writer.u32(micros());
    writer.u16(digitalRead(kButtonPin) == LOW ? 1 : 0);
    writer.number(position_);
    writer.number(velocity_);
    writer.number(applied_);
    writer.number(analogRead(kGripPin) / 1023.0f);
    writer.number(analogRead(kLightPin) / 1023.0f);
    writer.number(lamp_);
  }
  void send(const uint8_t* bytes, size_t size) override { Serial.write(bytes, size); }

  float position_ = 0;
  float velocity_ = 0;
  float applied_ = 0;
  float lamp_ = 0;
  uint32_t sensed_at_us_ = 0;
  bool has_position_ = false;
};

Paddle paddle;

}  // namespace

void setup() {
  pinMode(kMotorPin, OUTPUT);
  pinMode(kDirectionPin, OUTPUT);
  pinMode(kLampPin, OUTPUT);
  pinMode(kButtonPin, INPUT_PULLUP);
  analogWrite(kMotorPin, 0);
  analogWrite(kLampPin, 0);
  Serial.begin(kSpeedBaud);
  paddle.announce();
}

void loop() {
  paddle.sense(micros());
  while (Serial.available() > 0)
    paddle.take(static_cast<uint8_t>(Serial.read()), millis());
  paddle.watch(millis());
}
