// What a browser sends to rtpm-console: a frame, as text and as bytes, and the target of a request.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "foxglove/requests.hpp"
#include "rtpm/base/assert.hpp"
#include "web/request_rules.hpp"

using namespace rtpm;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes as text
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto request = console::foxglove::read_text(text);
  if (!request) RTPM_ASSERT(!request.error().empty(), "a mistake is told");
  const auto call = console::foxglove::read_binary(std::as_bytes(std::span(data, size)));
  if (call) {
    RTPM_ASSERT(call->encoding.size() + call->payload.size() + 13 == size,
                "all of the frame is read, and no more");
  }
  static_cast<void>(console::choose_subprotocol(text));
  static_cast<void>(console::content_security_policy(text));
  static_cast<void>(console::is_own_host(text, "127.0.0.1", 8765));
  if (const auto target = console::read_target(text)) {
    RTPM_ASSERT(target->path.find('\0') == std::string::npos, "a path is a text");
    static const std::filesystem::path kFolder = std::filesystem::temp_directory_path();
    if (const auto file = console::find_page_file(kFolder, target->path)) {
      RTPM_ASSERT(file->string().starts_with(std::filesystem::canonical(kFolder).string()),
                  "no file elsewhere is found");
    }
  }
  return 0;
}
