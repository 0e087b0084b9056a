// Any bytes from a serial line are cut into frames and faults, and the frames' contents are within
// their limits. The firmware's reader accepts the same frames.

#include <cmath>
#include <cstdint>
#include <span>

#include "rtpm/base/assert.hpp"
#include "rtpm/device_serial/board.hpp"
#include "rtpm/device_serial/frames.hpp"

#define RTPM_PAYLOAD_SIZE_MAX 1024
#include "../../devices/serial/firmware/rtpm_board/rtpm_frames.h"

using namespace rtpm;
using namespace rtpm::device_serial;

namespace {

void check_description(ConstBytes payload) {
  const auto board = parse_description(payload);
  RTPM_ASSERT(board || !board.error().empty(), "a refusal has words");
  if (!board) return;
  const BoardShape shape = board->shape();
  RTPM_ASSERT(shape.joint_count <= driver::kJointCountMax &&
                  shape.analog_count <= driver::kAnalogCountMax &&
                  shape.button_count <= driver::kButtonCountMax &&
                  shape.output_count <= driver::kOutputCountMax,
              "counts are within the driver's limits");
  for (const driver::Joint& joint : board->joints)
    RTPM_ASSERT(joint.low <= joint.high && std::isfinite(joint.effort_max), "ranges are finite");
  RTPM_ASSERT(board->rate_hz >= 1 && board->rate_hz <= kBoardRateMaxHz, "the rate has limits");
}

void check_state(ConstBytes payload) {
  constexpr BoardShape kShape{
      .joint_count = 1, .analog_count = 2, .button_count = 1, .output_count = 1};
  const auto state = parse_state(payload, kShape);
  if (!state) return;
  RTPM_ASSERT(std::isfinite(state->positions[0]) && std::isfinite(state->efforts[0]) &&
                  std::isfinite(state->analogs[1]) && std::isfinite(state->outputs[0]),
              "numbers are finite");
  RTPM_ASSERT(state->buttons <= 1, "a board has the buttons that it described");
}

/// A decoded frame stays the same when it is encoded and decoded again.
void check_round_trip(const Frame& frame) {
  std::array<std::byte, kWireSizeMax> wire{};
  const std::size_t size = encode(frame, wire);
  RTPM_ASSERT(size > 0 && wire[size - 1] == std::byte{0}, "every frame can be encoded");
  std::array<std::byte, kFrameSizeMax> buffer{};
  const auto again = decode(ConstBytes(wire).first(size - 1), buffer);
  RTPM_ASSERT(again && again->type == frame.type && again->sequence == frame.sequence &&
                  std::ranges::equal(again->payload, frame.payload),
              "a frame comes back as it was");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ConstBytes bytes = std::as_bytes(std::span(data, size));
  FrameCutter cutter;
  std::size_t frame_count = 0;
  for (const ConstBytes piece : {bytes.first(size / 2), bytes.subspan(size / 2)}) {
    cutter.push(piece, [&](const expected<Frame, FrameFault>& frame) {
      if (!frame) return;
      ++frame_count;
      RTPM_ASSERT(frame->payload.size() <= kPayloadSizeMax, "payloads have a limit");
      check_description(frame->payload);
      check_state(frame->payload);
      check_round_trip(*frame);
    });
  }
  rtpm_board::Reader reader;
  std::size_t board_frame_count = 0;
  for (std::size_t i = 0; i < size; ++i) {
    if (reader.take(data[i]) != rtpm_board::Reader::kFrame) continue;
    RTPM_ASSERT(reader.payload_size() <= RTPM_PAYLOAD_SIZE_MAX, "payloads have a limit");
    // The board checks the types.
    if (reader.type() >= rtpm_board::kHello && reader.type() <= rtpm_board::kState)
      ++board_frame_count;
  }
  RTPM_ASSERT(board_frame_count == frame_count, "host and firmware agree on what is a frame");
  // Payloads without the protection of a checksum.
  check_description(bytes);
  check_state(bytes);
  return 0;
}
