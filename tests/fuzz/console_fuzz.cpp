// A browser's input to rtpm-console: a frame, as text and as bytes, and the target of a request.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "foxglove/requests.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/nesting.hpp"
#include "web/request_rules.hpp"

using namespace rtpm;

namespace {

void check_values(const console::foxglove::TextRequest& request, bool may_command) {
  const auto* const set = std::get_if<console::foxglove::SetParameters>(&request);
  if (set == nullptr) return;
  for (const console::foxglove::ParameterRequest& one : set->parameters) {
    RTPM_ASSERT(may_command || one.value.is_null(), "an observer's values are not read");
    const std::string text =
        one.value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    RTPM_ASSERT(is_json_nested_within(text, kNestingMax), "no value nests deeply");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes as text
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const bool may_command : {false, true}) {
    const auto request = console::foxglove::read_text(text, may_command);
    if (!request) RTPM_ASSERT(!request.error().empty(), "a mistake has a reason");
    if (request) check_values(*request, may_command);
  }
  const auto call = console::foxglove::read_binary(std::as_bytes(std::span(data, size)));
  if (call) {
    RTPM_ASSERT(call->encoding.size() + call->payload.size() + 13 == size,
                "all of the frame is read, and no more");
  }
  static_cast<void>(console::choose_subprotocol(text));
  static_cast<void>(console::content_security_policy(text));
  static const std::vector<std::string> kNames{"192.168.1.9", "fe80::1"};
  if (console::is_own_host(text, kNames)) {
    RTPM_ASSERT(text.find_first_of("@/ ") == std::string_view::npos, "a host is a name and a port");
  }
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
