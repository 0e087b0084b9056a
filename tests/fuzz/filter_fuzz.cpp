// Any text is a filter or a mistake at one of its characters.

#include <array>
#include <cstdint>
#include <string_view>

#include "rtpm/base/assert.hpp"
#include "rtpm/events/filter_text.hpp"

using namespace rtpm;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static constexpr std::array kFields{
      events::FieldDescriptor{"force.z", events::ScalarType::kDouble, {.offset = 0}},
      events::FieldDescriptor{"keys", events::ScalarType::kUint8, {.offset = 8}}};
  static constexpr events::EventDescriptor kTouched{7, "lab.Touched", 1, kFields};
  static constexpr std::array kTypes{&kTouched};
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes as text
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto filter = events::parse_filter(text, kTypes);
  if (filter) return 0;
  RTPM_ASSERT(filter.error().offset <= size, "a mistake is in the text");
  RTPM_ASSERT(!filter.error().picture(text).empty(), "it can be shown");
  return 0;
}
