#include "preparsed_data.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

namespace rtpm::device_hid {
namespace {

constexpr std::string_view kMagic = "HidP KDR";
constexpr std::size_t kCapabilitySize = 104;
constexpr std::size_t kCollectionSize = 16;

// Offsets in the header.
constexpr std::size_t kInputFirst = 16;
constexpr std::size_t kInputEnd = 20;
constexpr std::size_t kInputReportSize = 22;
constexpr std::size_t kCollectionsOffset = 40;
constexpr std::size_t kCollectionCount = 42;

/// One or several equal controls.
struct Capability {
  std::uint8_t report_id = 0;
  std::uint32_t bit_offset = 0;  ///< Behind the byte of the report's number.
  std::uint32_t bit_size = 0;    ///< The size of one control.
  std::uint32_t count = 0;
  std::uint16_t flags = 0;  ///< Those of the main item.
  std::uint32_t usage_low = 0;
  std::uint32_t usage_high = 0;
  std::int32_t logical_low = 0;
  std::int32_t logical_high = 0;
  std::uint32_t application = 0;

  [[nodiscard]] std::uint32_t end() const noexcept { return bit_offset + bit_size * count; }
};

std::uint16_t word(ConstBytes bytes, std::size_t offset) noexcept {
  return load_le<std::uint16_t>(bytes.data() + offset);
}
std::int32_t number(ConstBytes bytes, std::size_t offset) noexcept {
  return static_cast<std::int32_t>(load_le<std::uint32_t>(bytes.data() + offset));
}

/// The usage of the application collection in which collection `index` lies.
std::uint32_t application_of(ConstBytes collections, std::size_t index) noexcept {
  constexpr std::byte kApplication{1};
  const std::size_t count = collections.size() / kCollectionSize;
  for (std::size_t depth = 0; index < count && depth < count; ++depth) {
    const ConstBytes node = collections.subspan(index * kCollectionSize, kCollectionSize);
    if (node[12] == kApplication || index == 0) {
      return static_cast<std::uint32_t>(word(node, 2)) << 16 | word(node, 0);
    }
    index = word(node, 4);
  }
  return 0;
}

/// @param bytes  of one capability
/// @return nullopt of padding, of another usage of the same control, and if it makes no sense
std::optional<Capability> read_capability(ConstBytes bytes, ConstBytes collections) noexcept {
  constexpr std::uint8_t kPadding = 0x02;
  constexpr std::uint8_t kButton = 0x04;
  constexpr std::uint8_t kRange = 0x10;
  constexpr std::uint8_t kAlias = 0x20;
  const auto kinds = std::to_integer<std::uint8_t>(bytes[24]);
  const std::uint16_t byte_position = word(bytes, 8);
  if ((kinds & (kPadding | kAlias)) != 0 || byte_position == 0) return std::nullopt;
  const std::uint32_t page = static_cast<std::uint32_t>(word(bytes, 0)) << 16;
  const std::size_t range = (kinds & kButton) != 0 ? 76 : 80;
  Capability capability{
      .report_id = std::to_integer<std::uint8_t>(bytes[2]),
      .bit_offset = 8U * (byte_position - 1U) + std::to_integer<std::uint8_t>(bytes[3]),
      .bit_size = word(bytes, 4),
      .count = word(bytes, 6),
      .flags = static_cast<std::uint16_t>(load_le<std::uint32_t>(bytes.data() + 12)),
      .usage_low = page | word(bytes, 60),
      .usage_high = page | word(bytes, (kinds & kRange) != 0 ? 62 : 60),
      .logical_low = number(bytes, range),
      .logical_high = number(bytes, range + 4),
      .application = application_of(collections, word(bytes, 18))};
  if (capability.bit_size == 0 || capability.count == 0) return std::nullopt;
  // Windows keeps no range of a button.
  if (capability.bit_size == 1) capability.logical_high = 1;
  // A device may write 255 as one byte, which Windows takes for -1.
  if (capability.logical_low >= 0 && capability.logical_high < 0 && capability.bit_size < 32) {
    capability.logical_high &= static_cast<std::int32_t>((1U << capability.bit_size) - 1);
  }
  return capability;
}

/// Writes items of a report descriptor.
class Writer {
 public:
  void begin_application(std::uint32_t usage) {
    end_application();
    item(0x08, usage, 4);
    item(0xa0, 1, 1);
    is_open_ = true;
  }
  void end_application() {
    if (std::exchange(is_open_, false)) item(0xc0, 0, 0);
  }
  void begin_report(std::uint8_t id) {
    if (id != 0) item(0x84, id, 1);
  }
  void pad(std::uint32_t bit_count) {
    constexpr std::uint16_t kConstant = 1;
    if (bit_count > 0) input(1, bit_count, kConstant);
  }
  void add(const Capability& capability) {
    item(0x18, capability.usage_low, 4);
    item(0x28, capability.usage_high, 4);
    item(0x14, static_cast<std::uint32_t>(capability.logical_low), 4);
    item(0x24, static_cast<std::uint32_t>(capability.logical_high), 4);
    input(capability.bit_size, capability.count, capability.flags);
  }
  [[nodiscard]] std::vector<std::byte> take() && {
    end_application();
    return std::move(bytes_);
  }

 private:
  void input(std::uint32_t bit_size, std::uint32_t count, std::uint16_t flags) {
    item(0x74, bit_size, 2);
    item(0x94, count, 2);
    item(0x80, flags, 2);
  }
  /// @param size  0, 1, 2 or 4
  void item(std::uint8_t tag, std::uint32_t data, std::uint8_t size) {
    bytes_.push_back(static_cast<std::byte>(tag | (size == 4 ? 3 : size)));
    for (std::uint8_t i = 0; i < size; ++i)
      bytes_.push_back(static_cast<std::byte>(data >> (8 * i)));
  }

  std::vector<std::byte> bytes_{};
  bool is_open_ = false;
};

/// The input controls in the order of their places, which is that of the device's own descriptor:
/// Windows keeps the usages of one item backwards.
std::vector<Capability> read_capabilities(ConstBytes preparsed) {
  const ConstBytes body = preparsed.subspan(kPreparsedHeaderSize);
  const ConstBytes collections = body.subspan(word(preparsed, kCollectionsOffset));
  std::vector<Capability> capabilities;
  for (std::size_t i = word(preparsed, kInputFirst); i < word(preparsed, kInputEnd); ++i) {
    const auto read =
        read_capability(body.subspan(i * kCapabilitySize, kCapabilitySize), collections);
    if (read) capabilities.push_back(*read);
  }
  std::ranges::stable_sort(capabilities, {}, [](const Capability& capability) {
    return std::pair(capability.report_id, capability.bit_offset);
  });
  return capabilities;
}

}  // namespace

std::size_t preparsed_size(ConstBytes header) noexcept {
  if (header.size() < kPreparsedHeaderSize) return 0;
  const bool is_known = std::ranges::equal(header.first(kMagic.size()), kMagic, {}, {},
                                           [](char letter) { return std::byte(letter); });
  const std::size_t offset = word(header, kCollectionsOffset);
  const std::size_t count = word(header, kCollectionCount);
  const std::size_t end = word(header, kInputEnd);
  if (!is_known || count == 0 || end * kCapabilitySize > offset) return 0;
  return kPreparsedHeaderSize + offset + count * kCollectionSize;
}

std::vector<std::byte> report_descriptor_from(ConstBytes preparsed) {
  const std::size_t size = preparsed_size(preparsed);
  if (size == 0 || preparsed.size() < size) return {};
  const std::vector<Capability> capabilities = read_capabilities(preparsed.first(size));
  Writer writer;
  const Capability* before = nullptr;
  std::uint32_t bits = 0;
  for (const Capability& capability : capabilities) {
    const bool is_new_report = before == nullptr || before->report_id != capability.report_id;
    if (is_new_report) bits = 0;
    // An array has a capability for each of its ranges of usages.
    if (capability.bit_offset < bits) continue;
    if (before == nullptr || before->application != capability.application) {
      writer.begin_application(capability.application);
    }
    if (is_new_report) writer.begin_report(capability.report_id);
    writer.pad(capability.bit_offset - bits);
    writer.add(capability);
    bits = capability.end();
    before = &capability;
  }
  // A device without report numbers has one report, whose size is known.
  const std::uint32_t bits_max = 8U * std::max<std::uint32_t>(word(preparsed, kInputReportSize), 1);
  if (before != nullptr && before->report_id == 0 && bits + 8 < bits_max) {
    writer.pad(bits_max - 8 - bits);
  }
  return std::move(writer).take();
}

}  // namespace rtpm::device_hid
