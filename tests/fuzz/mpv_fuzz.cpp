// Any bytes from a media player are cut into lines, and each line is a message of one kind.

#include <cmath>
#include <cstdint>
#include <string_view>

#include "rtpm/base/assert.hpp"
#include "rtpm/device_mpv/protocol.hpp"

using namespace rtpm;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes as text
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  device_mpv::LineCutter cutter;
  std::size_t line_size = 0;
  // The bytes come in two pieces, as a socket may split them.
  for (const std::string_view piece : {bytes.substr(0, size / 2), bytes.substr(size / 2)}) {
    cutter.push(piece, [&](std::string_view line) {
      line_size += line.size();
      RTPM_ASSERT(line.find('\n') == std::string_view::npos, "a line is one line");
      const auto message = device_mpv::parse(line);
      const auto* const reply = std::get_if<device_mpv::Reply>(&message);
      RTPM_ASSERT(reply == nullptr || !reply->number || std::isfinite(*reply->number),
                  "numbers are finite");
      RTPM_ASSERT(reply == nullptr || !reply->number || !reply->flag, "data is of one type");
    });
  }
  RTPM_ASSERT(line_size <= size, "no byte is invented");
  return 0;
}
