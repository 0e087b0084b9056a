#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

// The part of Arduino's interface that the sketch uses, with a clock and pins that a test sets. Its
// names are Arduino's. The sketch is compiled unchanged, by inclusion.

inline constexpr std::uint8_t LOW = 0;
inline constexpr std::uint8_t HIGH = 1;
inline constexpr std::uint8_t OUTPUT = 1;
inline constexpr std::uint8_t INPUT_PULLUP = 2;
inline constexpr std::uint8_t A2 = 16;
inline constexpr std::uint8_t A3 = 17;
inline constexpr std::uint8_t A4 = 18;

namespace rtpm::test {

struct FakeArduino {
  std::uint64_t time_us = 0;
  std::array<int, 20> levels{};   ///< The values that analogRead() and digitalRead() return.
  std::array<int, 20> written{};  ///< The values that analogWrite() and digitalWrite() set.
  std::array<bool, 20> is_output{};
  std::deque<std::uint8_t> received{};
  std::vector<std::byte> sent{};
  std::uint32_t speed_baud = 0;
};
inline FakeArduino fake_arduino;

struct FakeSerial {
  void begin(std::uint32_t speed_baud) { fake_arduino.speed_baud = speed_baud; }
  [[nodiscard]] int available() const { return static_cast<int>(fake_arduino.received.size()); }
  int read() {
    const int byte = fake_arduino.received.front();
    fake_arduino.received.pop_front();
    return byte;
  }
  void write(const std::uint8_t* bytes, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
      fake_arduino.sent.push_back(static_cast<std::byte>(bytes[i]));
  }
};

}  // namespace rtpm::test

inline rtpm::test::FakeSerial Serial;

inline std::uint32_t micros() {
  return static_cast<std::uint32_t>(rtpm::test::fake_arduino.time_us);
}
inline std::uint32_t millis() {
  return static_cast<std::uint32_t>(rtpm::test::fake_arduino.time_us / 1000);
}
inline void pinMode(std::uint8_t pin, std::uint8_t mode) {
  rtpm::test::fake_arduino.is_output.at(pin) = mode == OUTPUT;
}
inline int analogRead(std::uint8_t pin) {
  return rtpm::test::fake_arduino.levels.at(pin);
}
inline int digitalRead(std::uint8_t pin) {
  return rtpm::test::fake_arduino.levels.at(pin);
}
inline void analogWrite(std::uint8_t pin, int value) {
  rtpm::test::fake_arduino.written.at(pin) = value;
}
inline void digitalWrite(std::uint8_t pin, int value) {
  rtpm::test::fake_arduino.written.at(pin) = value;
}
