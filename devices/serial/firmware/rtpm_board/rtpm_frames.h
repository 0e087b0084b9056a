#pragma once

// The board's side of FRAMES.md: frames in both directions, the session and the watchdog. Plain
// C++11 without heap and library, for any microcontroller, and for the tests on the host.

#include <stddef.h>
#include <stdint.h>
#include <string.h>

// The largest payload that the board sends or takes: its description, as a rule.
#ifndef RTPM_PAYLOAD_SIZE_MAX
#define RTPM_PAYLOAD_SIZE_MAX 160
#endif

namespace rtpm_board {

const uint8_t kVersion = 1;
const size_t kHeaderSize = 6;
const size_t kChecksumSize = 4;
const size_t kFrameSizeMax = kHeaderSize + RTPM_PAYLOAD_SIZE_MAX + kChecksumSize;
const size_t kWireSizeMax = kFrameSizeMax + kFrameSizeMax / 254 + 2;
const size_t kJointCountMax = 8;
const size_t kOutputCountMax = 8;
const uint16_t kWatchdogMaxMs = 1000;

enum FrameType { kHello = 1, kDescription = 2, kCommand = 3, kState = 4 };
enum Status { kStatusWatchdog = 1, kStatusSaturated = 2 };

// CRC-32 as of zlib, by half bytes: 64 bytes of table instead of 1024.
inline uint32_t crc32(const uint8_t* bytes, size_t size) {
  static const uint32_t kTable[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac,
                                      0x76dc4190, 0x6b6b51f4, 0x4db26158, 0x5005713c,
                                      0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                      0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
  uint32_t value = 0xffffffff;
  for (size_t i = 0; i < size; ++i) {
    value ^= bytes[i];
    value = (value >> 4) ^ kTable[value & 15];
    value = (value >> 4) ^ kTable[value & 15];
  }
  return ~value;
}

// Writes one frame: begin(), the payload's fields, finish().
class Writer {
 public:
  void begin(uint8_t type, uint16_t sequence) {
    size_ = 0;
    is_full_ = false;
    u8(kVersion);
    u8(type);
    u16(sequence);
    u16(0);  // The length, which finish() knows.
  }
  void u8(uint8_t value) {
    if (size_ + kChecksumSize >= kFrameSizeMax) {
      is_full_ = true;
    } else {
      frame_[size_++] = value;
    }
  }
  void u16(uint16_t value) {
    u8(static_cast<uint8_t>(value & 0xff));
    u8(static_cast<uint8_t>(value >> 8));
  }
  void u32(uint32_t value) {
    u16(static_cast<uint16_t>(value & 0xffff));
    u16(static_cast<uint16_t>(value >> 16));
  }
  void number(float value) {
    uint32_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    u32(bits);
  }
  void text(const char* value) {
    const size_t size = strlen(value);
    u8(static_cast<uint8_t>(size));
    for (size_t i = 0; i < size; ++i)
      u8(static_cast<uint8_t>(value[i]));
  }
  // The bytes for the line, delimiter included; 0: the frame does not fit.
  size_t finish() {
    if (is_full_) return 0;
    const size_t payload_size = size_ - kHeaderSize;
    frame_[4] = static_cast<uint8_t>(payload_size & 0xff);
    frame_[5] = static_cast<uint8_t>(payload_size >> 8);
    const uint32_t checksum = crc32(frame_, size_);
    for (size_t i = 0; i < kChecksumSize; ++i)
      frame_[size_++] = static_cast<uint8_t>(checksum >> (8 * i));
    return stuff();
  }
  const uint8_t* wire() const { return wire_; }

 private:
  size_t stuff() {
    size_t code_at = 0;
    size_t to = 1;
    for (size_t i = 0; i < size_; ++i) {
      if (frame_[i] != 0) wire_[to++] = frame_[i];
      const bool is_full_group = to - code_at == 255 && i + 1 < size_;
      if (frame_[i] == 0 || is_full_group) {
        wire_[code_at] = static_cast<uint8_t>(to - code_at);
        code_at = to++;
      }
    }
    wire_[code_at] = static_cast<uint8_t>(to - code_at);
    wire_[to++] = 0;
    return to;
  }

  uint8_t frame_[kFrameSizeMax];
  uint8_t wire_[kWireSizeMax];
  size_t size_ = 0;
  bool is_full_ = false;
};

// Takes the line's bytes one by one, and holds the frame that the last of them completed.
class Reader {
 public:
  enum Result { kNothing, kFrame, kBad };

  Result take(uint8_t byte) {
    if (byte != 0) {
      if (size_ < kWireSizeMax) bytes_[size_] = byte;
      if (size_ <= kWireSizeMax) ++size_;
      return kNothing;
    }
    const size_t size = size_;
    size_ = 0;
    if (size == 0) return kNothing;
    return size <= kWireSizeMax && unstuff(size) && is_whole() ? kFrame : kBad;
  }
  uint8_t type() const { return bytes_[1]; }
  uint16_t sequence() const { return u16_at(2); }
  const uint8_t* payload() const { return bytes_ + kHeaderSize; }
  size_t payload_size() const { return frame_size_ - kHeaderSize - kChecksumSize; }

 private:
  // In place: what is read is never in front of what is written.
  bool unstuff(size_t size) {
    size_t to = 0;
    size_t at = 0;
    while (at < size) {
      const size_t run = static_cast<size_t>(bytes_[at++]) - 1;
      if (run > size - at) return false;
      for (size_t i = 0; i < run; ++i)
        bytes_[to++] = bytes_[at++];
      if (run < 254 && at < size) bytes_[to++] = 0;
    }
    frame_size_ = to;
    return true;
  }
  bool is_whole() const {
    if (frame_size_ < kHeaderSize + kChecksumSize || frame_size_ > kFrameSizeMax) return false;
    const size_t body_size = frame_size_ - kChecksumSize;
    uint32_t checksum = 0;
    for (size_t i = 0; i < kChecksumSize; ++i)
      checksum |= static_cast<uint32_t>(bytes_[body_size + i]) << (8 * i);
    return checksum == crc32(bytes_, body_size) && bytes_[0] == kVersion &&
           u16_at(4) == body_size - kHeaderSize;
  }
  uint16_t u16_at(size_t at) const {
    return static_cast<uint16_t>(bytes_[at] | (static_cast<uint16_t>(bytes_[at + 1]) << 8));
  }

  uint8_t bytes_[kWireSizeMax];
  size_t size_ = 0;
  size_t frame_size_ = 0;
};

// A board: greets, answers each command with a state, and lets its watchdog set the efforts to zero
// and the outputs to their safe values. A sketch derives from it and says what the board has.
class Board {
 public:
  Board(uint8_t joint_count, uint8_t output_count)
      : joint_count_(joint_count), output_count_(output_count) {}

  // Call once when the board has started: a host that waits for it need not wait longer.
  void announce() { send_description(0); }
  // Call with each byte that comes from the host.
  void take(uint8_t byte, uint32_t now_ms) {
    const Reader::Result result = reader_.take(byte);
    if (result == Reader::kNothing) return;
    bool is_good = result == Reader::kFrame;
    if (is_good && reader_.type() == kHello) {
      is_good = take_hello();
    } else if (is_good && reader_.type() == kCommand) {
      is_good = is_greeted_ && take_command(now_ms);
      if (is_good) send_state();
    } else {
      is_good = false;
    }
    if (!is_good) ++bad_frame_count_;
  }
  // Call in each turn of the loop, at least every millisecond.
  void watch(uint32_t now_ms) {
    if (!is_on_ || now_ms - commanded_at_ms_ < watchdog_ms_) return;
    switch_off();
    is_watchdog_over_ = true;
  }
  // Whether a command is in force. If not, efforts are zero and outputs safe.
  bool is_on() const { return is_on_; }
  // As commanded, finite, but not clamped to any range.
  float effort(uint8_t joint) const { return efforts_[joint]; }
  float output(uint8_t output) const { return is_on_ ? outputs_[output] : safe_output(output); }

 protected:
  ~Board() {}
  // Name, serial number and channels, as FRAMES.md has them after the rate.
  virtual void describe(Writer& writer) = 0;
  virtual uint16_t rate_hz() const = 0;
  // Applies efforts and outputs now, clamped to what the board has, before measure().
  virtual void apply() = 0;
  // Whether apply() applied less than commanded.
  virtual bool is_saturated() const = 0;
  // Time in microseconds (u32), buttons (u16), then the numbers of joints, analogs and outputs.
  virtual void measure(Writer& writer) = 0;
  virtual float safe_output(uint8_t output) const = 0;
  virtual void send(const uint8_t* bytes, size_t size) = 0;

 private:
  bool take_hello() {
    if (reader_.payload_size() != 4) return false;
    uint32_t nonce = 0;
    for (size_t i = 0; i < 4; ++i)
      nonce |= static_cast<uint32_t>(reader_.payload()[i]) << (8 * i);
    switch_off();
    is_watchdog_over_ = false;
    is_greeted_ = true;
    command_sequence_ = reader_.sequence();
    send_description(nonce);
    return true;
  }
  bool take_command(uint32_t now_ms) {
    const uint8_t* const payload = reader_.payload();
    if (reader_.payload_size() != 3u + 4u * (joint_count_ + output_count_)) return false;
    const uint16_t step = static_cast<uint16_t>(reader_.sequence() - command_sequence_);
    if (step == 0 || step > 0x7fff) return false;  // A repeated or stale command.
    const uint16_t watchdog_ms =
        static_cast<uint16_t>(payload[1] | (static_cast<uint16_t>(payload[2]) << 8));
    if (payload[0] > 1 || watchdog_ms == 0 || watchdog_ms > kWatchdogMaxMs) return false;
    for (size_t i = 0; i < static_cast<size_t>(joint_count_) + output_count_; ++i)
      if (!is_finite(payload + 3 + 4 * i)) return false;
    command_sequence_ = reader_.sequence();
    is_watchdog_over_ = false;
    if (payload[0] == 0) {
      switch_off();
      return true;
    }
    for (size_t i = 0; i < joint_count_; ++i)
      memcpy(&efforts_[i], payload + 3 + 4 * i, 4);
    for (size_t i = 0; i < output_count_; ++i)
      memcpy(&outputs_[i], payload + 3 + 4 * (joint_count_ + i), 4);
    is_on_ = true;
    watchdog_ms_ = watchdog_ms;
    commanded_at_ms_ = now_ms;
    apply();
    return true;
  }
  // By its bits, because compilers of microcontrollers often leave isfinite() out.
  static bool is_finite(const uint8_t* number) {
    return (number[3] & 0x7f) != 0x7f || (number[2] & 0x80) == 0;
  }
  void switch_off() {
    is_on_ = false;
    for (size_t i = 0; i < kJointCountMax; ++i)
      efforts_[i] = 0;
    apply();
  }
  void send_description(uint32_t nonce) {
    writer_.begin(kDescription, ++sequence_);
    writer_.u32(nonce);
    writer_.u16(rate_hz());
    describe(writer_);
    send_frame();
  }
  void send_state() {
    writer_.begin(kState, ++sequence_);
    writer_.u16(command_sequence_);
    writer_.u8(static_cast<uint8_t>((is_watchdog_over_ ? kStatusWatchdog : 0) |
                                    (is_saturated() ? kStatusSaturated : 0)));
    writer_.u8(bad_frame_count_);
    measure(writer_);
    send_frame();
  }
  void send_frame() {
    const size_t size = writer_.finish();
    if (size > 0) send(writer_.wire(), size);
  }

  Reader reader_;
  Writer writer_;
  uint8_t joint_count_;
  uint8_t output_count_;
  bool is_greeted_ = false;
  bool is_on_ = false;
  bool is_watchdog_over_ = false;
  uint8_t bad_frame_count_ = 0;
  uint16_t sequence_ = 0;
  uint16_t command_sequence_ = 0;
  uint16_t watchdog_ms_ = 0;
  uint32_t commanded_at_ms_ = 0;
  float efforts_[kJointCountMax] = {};
  float outputs_[kOutputCountMax] = {};
};

}  // namespace rtpm_board
