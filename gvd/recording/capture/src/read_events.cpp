#include "rtpm/capture/read_events.hpp"

#include "rtpm/capture/channels.hpp"

namespace rtpm::capture {
expected<std::vector<std::uint16_t>, SetupError> channels_of_event(
    const recording::FileReader& reader, const events::EventDescriptor& type) {
  std::vector<std::uint16_t> numbers;
  for (const auto& [number, channel] : reader.channels()) {
    if (value_of(channel, kTypeKey) != std::to_string(type.type)) continue;
    if (value_of(channel, kSchemaIdKey) != std::to_string(type.schema_id)) {
      return setup_error(
          channel.topic + " was recorded with another version of " + std::string(type.name), "",
          "read it with the release that recorded it");
    }
    numbers.push_back(number);
  }
  if (!numbers.empty()) return numbers;
  return setup_error("the recording has no event " + std::string(type.name), "",
                     "see what it has: rtpm bag info");
}

ConstBytes struct_in_table(ConstBytes table, std::size_t size) noexcept {
  const auto read = [&](std::size_t at, auto& value) {
    if (at > table.size() || table.size() - at < sizeof value) return false;
    std::memcpy(&value, table.data() + at, sizeof value);
    return true;
  };
  std::uint32_t root = 0;
  std::int32_t back = 0;
  std::uint16_t vtable_size = 0;
  std::uint16_t field = 0;
  if (!read(0, root) || !read(root, back)) return {};
  const std::int64_t vtable = std::int64_t{root} - back;
  constexpr std::int64_t kFieldAt = 4;
  if (vtable < 0) return {};
  const auto at = static_cast<std::size_t>(vtable);
  if (!read(at, vtable_size) || vtable_size < kFieldAt + 2 || !read(at + kFieldAt, field))
    return {};
  const std::size_t begin = std::size_t{root} + field;
  if (field == 0 || begin > table.size() || table.size() - begin < size) return {};
  return table.subspan(begin, size);
}

}  // namespace rtpm::capture
