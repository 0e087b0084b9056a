#include "rtpm/device_hid/report_descriptor.hpp"

#include <algorithm>
#include <span>

namespace rtpm::device_hid {
namespace {

constexpr std::size_t kStackMax = 8;
constexpr std::size_t kCollectionDepthMax = 16;
constexpr std::size_t kUsageRangeMax = 64;
constexpr std::uint64_t kReportBitsMax = 8 * 4096;

enum class ItemType : std::uint8_t { kMain = 0, kGlobal = 1, kLocal = 2, kReserved = 3 };

/// Items of the state that Push and Pop save.
struct Globals {
  std::uint32_t usage_page = 0;
  std::int64_t logical_low = 0;
  std::int32_t logical_high_signed = 0;
  std::uint32_t logical_high_unsigned = 0;
  std::uint32_t report_size = 0;
  std::uint32_t report_count = 0;
  std::uint8_t report_id = 0;

  /// Many devices write 255 as one byte, which reads as -1.
  [[nodiscard]] std::int64_t logical_high() const noexcept {
    return logical_low >= 0 ? std::int64_t{logical_high_unsigned}
                            : std::int64_t{logical_high_signed};
  }
};

/// Usages from `low` to `high`; those without a page take the page of the main item.
struct UsageRange {
  std::uint32_t low = 0;
  std::uint32_t high = 0;
  bool has_page = false;
};

struct Item {
  ItemType type{};
  std::uint8_t tag = 0;
  std::uint8_t size = 0;
  std::uint32_t data = 0;

  [[nodiscard]] std::int32_t signed_data() const noexcept {
    if (size == 1) return static_cast<std::int8_t>(data);
    if (size == 2) return static_cast<std::int16_t>(data);
    return static_cast<std::int32_t>(data);
  }
};

class Parser {
 public:
  /// @return what is wrong; null: nothing
  [[nodiscard]] const char* take(const Item& item) {
    switch (item.type) {
      case ItemType::kMain:
        return take_main(item);
      case ItemType::kGlobal:
        return take_global(item);
      case ItemType::kLocal:
        return take_local(item);
      default:
        return "an item of a reserved type";
    }
  }
  [[nodiscard]] const char* end() const noexcept {
    return collections_.empty() ? nullptr : "a collection without an end";
  }
  [[nodiscard]] ReportDescriptor result() && {
    for (std::size_t id = 0; id < input_bits_.size(); ++id) {
      const std::uint32_t bytes = (input_bits_[id] + 7) / 8;
      if (bytes > 0) descriptor_.input_sizes[id] = static_cast<std::uint16_t>(bytes);
    }
    return std::move(descriptor_);
  }

 private:
  [[nodiscard]] const char* take_main(const Item& item) {
    const char* problem = nullptr;
    constexpr std::uint8_t kInput = 8;
    constexpr std::uint8_t kCollection = 10;
    constexpr std::uint8_t kEndCollection = 12;
    if (item.tag == kInput) problem = take_input(item.data);
    if (item.tag == kCollection) problem = begin_collection(item.data);
    if (item.tag == kEndCollection) {
      if (collections_.empty()) return "the end of a collection that never began";
      collections_.pop_back();
    }
    usages_.clear();
    has_usage_low_ = false;
    return problem;
  }

  [[nodiscard]] const char* begin_collection(std::uint32_t type) {
    if (collections_.size() == kCollectionDepthMax) return "collections within too many others";
    constexpr std::uint32_t kApplication = 1;
    const std::uint32_t outer = collections_.empty() ? 0 : collections_.back();
    collections_.push_back(type == kApplication ? usage_at(0) : outer);
    return nullptr;
  }

  [[nodiscard]] const char* take_input(std::uint32_t flags) {
    constexpr std::uint32_t kConstant = 1;
    constexpr std::uint32_t kVariable = 2;
    constexpr std::uint32_t kRelative = 4;
    constexpr std::uint32_t kNull = 0x40;
    std::uint32_t& bits = input_bits_[globals_.report_id];
    if (bits == 0 && globals_.report_id != 0) bits = 8;
    const std::uint64_t added = std::uint64_t{globals_.report_size} * globals_.report_count;
    if (added > kReportBitsMax || bits + added > kReportBitsMax) return "a report that is too long";
    const bool has_values = (flags & kConstant) == 0 && (flags & kVariable) != 0 &&
                            globals_.report_size > 0 && globals_.report_size <= 32;
    for (std::uint32_t i = 0; has_values && i < globals_.report_count; ++i) {
      if (descriptor_.inputs.size() == kFieldCountMax) return "too many fields";
      descriptor_.inputs.push_back({.usage = usage_at(i),
                                    .application = collections_.empty() ? 0 : collections_.back(),
                                    .report_id = globals_.report_id,
                                    .bit_offset = bits + i * globals_.report_size,
                                    .bit_size = static_cast<std::uint8_t>(globals_.report_size),
                                    .logical_low = globals_.logical_low,
                                    .logical_high = globals_.logical_high(),
                                    .is_relative = (flags & kRelative) != 0,
                                    .has_null = (flags & kNull) != 0});
    }
    bits += static_cast<std::uint32_t>(added);
    return nullptr;
  }

  /// The usage of the field `index` of a main item: the last one goes for all that follow.
  [[nodiscard]] std::uint32_t usage_at(std::uint32_t index) const noexcept {
    std::uint32_t usage = 0;
    for (const UsageRange& range : usages_) {
      const std::uint32_t page = range.has_page ? 0 : globals_.usage_page;
      const std::uint64_t count = std::uint64_t{range.high} - range.low + 1;
      if (index < count) return page + range.low + index;
      usage = page + range.high;
      index -= static_cast<std::uint32_t>(count);
    }
    return usage;
  }

  [[nodiscard]] const char* take_global(const Item& item) {
    switch (item.tag) {
      case 0:
        if (item.data > 0xffff) return "a usage page that is too high";
        globals_.usage_page = item.data << 16;
        return nullptr;
      case 1:
        globals_.logical_low = item.signed_data();
        return nullptr;
      case 2:
        globals_.logical_high_signed = item.signed_data();
        globals_.logical_high_unsigned = item.data;
        return nullptr;
      case 7:
        globals_.report_size = item.data;
        return nullptr;
      case 8:
        if (item.data == 0 || item.data > 255) return "a report number out of 1 to 255";
        globals_.report_id = static_cast<std::uint8_t>(item.data);
        descriptor_.has_report_ids = true;
        return nullptr;
      case 9:
        globals_.report_count = item.data;
        return nullptr;
      case 10:
        if (stack_.size() == kStackMax) return "too many pushed states";
        stack_.push_back(globals_);
        return nullptr;
      case 11:
        if (stack_.empty()) return "a pop without a push";
        globals_ = stack_.back();
        stack_.pop_back();
        return nullptr;
      default:  // Physical range, unit and reserved ones: not used.
        return nullptr;
    }
  }

  [[nodiscard]] const char* take_local(const Item& item) {
    const bool has_page = item.size == 4;
    if (item.tag == 0) return add_usages({item.data, item.data, has_page});
    if (item.tag == 1) {
      usage_low_ = {item.data, item.data, has_page};
      has_usage_low_ = true;
    }
    if (item.tag == 2 && has_usage_low_) {
      has_usage_low_ = false;
      if (item.data < usage_low_.low || has_page != usage_low_.has_page) {
        return "usages from a higher to a lower one";
      }
      return add_usages({usage_low_.low, item.data, has_page});
    }
    return nullptr;
  }
  [[nodiscard]] const char* add_usages(const UsageRange& range) {
    if (usages_.size() == kUsageRangeMax) return "too many usages of a field";
    usages_.push_back(range);
    return nullptr;
  }

  Globals globals_{};
  std::vector<Globals> stack_{};
  std::vector<std::uint32_t> collections_{};  ///< The application of each.
  std::vector<UsageRange> usages_{};
  UsageRange usage_low_{};
  bool has_usage_low_ = false;
  std::array<std::uint32_t, 256> input_bits_{};
  ReportDescriptor descriptor_{};
};

/// Takes the next item off `bytes`; nothing: it is cut off.
std::optional<Item> next_item(ConstBytes& bytes) noexcept {
  const auto prefix = std::to_integer<std::uint8_t>(bytes[0]);
  const std::size_t size = (prefix & 3) == 3 ? 4 : prefix & 3;
  if (bytes.size() < 1 + size) return std::nullopt;
  Item item{static_cast<ItemType>(prefix >> 2 & 3), static_cast<std::uint8_t>(prefix >> 4),
            static_cast<std::uint8_t>(size), 0};
  for (std::size_t i = 0; i < size; ++i)
    item.data |= std::to_integer<std::uint32_t>(bytes[1 + i]) << (8 * i);
  bytes = bytes.subspan(1 + size);
  return item;
}

}  // namespace

expected<ReportDescriptor, std::string> parse_report_descriptor(ConstBytes bytes) {
  if (bytes.size() > kDescriptorSizeMax) return unexpected{std::string("it is too long")};
  Parser parser;
  while (!bytes.empty()) {
    // Long items, which no device has, are of a reserved type.
    const auto item = next_item(bytes);
    const char* const problem = item ? parser.take(*item) : "its last item is cut off";
    if (problem != nullptr) return unexpected{std::string(problem)};
  }
  if (const char* const problem = parser.end()) return unexpected{std::string(problem)};
  return std::move(parser).result();
}

std::optional<std::int64_t> value_of(const Field& field, ConstBytes report) noexcept {
  if (report.empty() || std::size_t{field.bit_offset} + field.bit_size > report.size() * 8) {
    return std::nullopt;
  }
  if (field.report_id != 0 && std::to_integer<std::uint8_t>(report[0]) != field.report_id) {
    return std::nullopt;
  }
  std::uint64_t value = 0;
  for (std::uint32_t i = 0; i < field.bit_size; ++i) {
    const std::uint32_t bit = field.bit_offset + i;
    const auto byte = std::to_integer<std::uint64_t>(report[bit / 8]);
    value |= (byte >> (bit % 8) & 1) << i;
  }
  const std::uint64_t sign = std::uint64_t{1} << (field.bit_size - 1);
  if (field.logical_low < 0 && (value & sign) != 0) {
    return static_cast<std::int64_t>(value) - static_cast<std::int64_t>(sign << 1);
  }
  return static_cast<std::int64_t>(value);
}

}  // namespace rtpm::device_hid
