#include "rtpm/device_hid/report_descriptor.hpp"

#include <algorithm>
#include <span>

namespace rtpm::device_hid {
namespace {

// The limits in Linux, drivers/hid/hid-core.c, except for kStackMax, which is 4 there.
constexpr std::size_t kStackMax = 8;
constexpr std::uint32_t kUsageCountMax = 12'288;  ///< Limit per main item.
constexpr std::uint32_t kReportSizeMax = 256;     ///< Limit in bits per field.
constexpr std::uint64_t kReportBitsMax = 8 * (16'384 - 1);

constexpr std::byte kLongItem{0xfe};

enum class ItemType : std::uint8_t { kMain = 0, kGlobal = 1, kLocal = 2, kReserved = 3 };

/// The items whose state Push and Pop save.
struct Globals {
  std::uint32_t usage_page = 0;
  std::int64_t logical_low = 0;
  std::int64_t logical_high = 0;
  std::uint32_t report_size = 0;
  std::uint32_t report_count = 0;
  std::uint8_t report_id = 0;
};

/// A range of `count` usages, starting at `first`, which includes the page.
struct UsageRange {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  bool is_short = false;  ///< Whether the usage was written without a page.
};

constexpr std::uint32_t with_page(std::uint32_t usage, std::uint32_t page) noexcept {
  return page | (usage & 0xffff);
}
constexpr std::uint32_t page_of(std::uint32_t usage) noexcept {
  return usage & 0xffff'0000;
}
constexpr bool is_known_page(std::uint32_t page) noexcept {
  return page == kDesktopPage || page == kSimulationPage || page == kButtonPage;
}

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
  /// @return the fault; null if there is none
  [[nodiscard]] const char* take(const Item& item) {
    switch (item.type) {
      case ItemType::kMain:
        return take_main(item);
      case ItemType::kGlobal:
        return take_global(item);
      case ItemType::kLocal:
        return take_local(item);
      default:
        return nullptr;  // Reserved: ignored, as in Linux.
    }
  }
  [[nodiscard]] const char* end() const noexcept {
    if (is_in_delimiter_) return "a delimiter without an end";
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
    complete_usages();
    if (item.tag == kInput) problem = take_input(item.data);
    if (item.tag == kCollection) begin_collection(item.data & 0xff);
    if (item.tag == kEndCollection) {
      if (collections_.empty()) return "the end of a collection that never began";
      collections_.pop_back();
    }
    usages_.clear();
    usage_count_ = 0;
    usage_low_ = 0;
    delimiter_count_ = 0;
    is_in_delimiter_ = false;
    return problem;
  }

  /// A usage has the page of the preceding page item. If another page item follows the last usages,
  /// they get that page, back to the first usage that already has it.
  void complete_usages() noexcept {
    for (std::size_t i = usages_.size(); i > 0; --i) {
      UsageRange& range = usages_[i - 1];
      if (!range.is_short) continue;
      if (page_of(range.first) == globals_.usage_page) return;
      range.first = with_page(range.first, globals_.usage_page);
    }
  }

  void begin_collection(std::uint32_t type) {
    constexpr std::uint32_t kApplication = 1;
    const std::uint32_t usage = usages_.empty() ? 0 : usages_.front().first;
    collections_.push_back(type == kApplication ? usage : application());
  }
  [[nodiscard]] std::uint32_t application() const noexcept {
    return collections_.empty() ? 0 : collections_.back();
  }

  [[nodiscard]] const char* take_input(std::uint32_t flags) {
    constexpr std::uint32_t kConstant = 1;
    std::uint32_t& bits = input_bits_[globals_.report_id];
    if (bits == 0 && globals_.report_id != 0) bits = 8;
    const std::uint64_t added = std::uint64_t{globals_.report_size} * globals_.report_count;
    if (bits + added > kReportBitsMax) return "a report that is too long";
    // A field without a usage is padding, regardless of its flags.
    const bool has_values =
        (flags & kConstant) == 0 && !usages_.empty() && globals_.report_size > 0;
    if (has_values) add_fields(flags, bits);
    bits += static_cast<std::uint32_t>(added);
    return nullptr;
  }

  void add_fields(std::uint32_t flags, std::uint32_t bits) {
    constexpr std::uint32_t kVariable = 2;
    constexpr std::uint32_t kRelative = 4;
    constexpr std::uint32_t kNull = 0x40;
    Field field{.application = application(),
                .report_id = globals_.report_id,
                .bit_size = static_cast<std::uint8_t>(std::min(globals_.report_size, 32U)),
                .logical_low = globals_.logical_low,
                .logical_high = globals_.logical_high,
                .is_relative = (flags & kRelative) != 0,
                .has_null = (flags & kNull) != 0};
    const bool is_read = (flags & kVariable) != 0 && globals_.report_size <= 32;
    std::uint32_t index = 0;
    for (std::size_t i = 0; i < usages_.size() && index < globals_.report_count; ++i) {
      const UsageRange& range = usages_[i];
      // The last usage applies to all remaining fields.
      const bool is_last = i + 1 == usages_.size();
      const std::uint32_t end =
          is_last ? globals_.report_count : std::min(index + range.count, globals_.report_count);
      for (std::uint32_t offset = 0; index < end; ++index, ++offset) {
        if (!is_read || !is_known_page(page_of(range.first)) ||
            descriptor_.inputs.size() == kFieldCountMax) {
          count_unread(page_of(range.first), end - index);
          index = end;
          break;
        }
        field.usage = range.first + std::min(offset, range.count - 1);
        field.bit_offset = bits + index * globals_.report_size;
        descriptor_.inputs.push_back(field);
      }
    }
  }

  void count_unread(std::uint32_t page, std::uint32_t count) {
    const auto known = std::ranges::find_if(descriptor_.unread, [&](const UnreadFields& fields) {
      return fields.application == application() && fields.page == page;
    });
    if (known != descriptor_.unread.end()) {
      known->count += count;
    } else if (descriptor_.unread.size() < kUnreadCountMax) {
      descriptor_.unread.push_back({application(), page, count});
    }
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
        // Many devices write 255 as one byte, which is read as -1.
        globals_.logical_high =
            globals_.logical_low < 0 ? std::int64_t{item.signed_data()} : std::int64_t{item.data};
        return nullptr;
      case 7:
        if (item.data > kReportSizeMax) return "a field that is too long";
        globals_.report_size = item.data;
        return nullptr;
      case 8:
        if (item.data == 0 || item.data > 255) return "a report number out of 1 to 255";
        globals_.report_id = static_cast<std::uint8_t>(item.data);
        descriptor_.has_report_ids = true;
        return nullptr;
      case 9:
        if (item.data > kUsageCountMax) return "a report with too many fields";
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
      default:  // Physical range, unit and reserved items are not used.
        return nullptr;
    }
  }

  [[nodiscard]] const char* take_local(const Item& item) {
    constexpr std::uint8_t kUsage = 0;
    constexpr std::uint8_t kUsageLow = 1;
    constexpr std::uint8_t kUsageHigh = 2;
    constexpr std::uint8_t kDelimiter = 10;
    if (item.tag == kDelimiter) return take_delimiter(item.data != 0);
    // Only the first of several alternative usages counts.
    if (delimiter_count_ > 1) return nullptr;
    if (item.tag == kUsage) return add_usages(item.data, item.data, item.size <= 2);
    if (item.tag == kUsageLow) usage_low_ = item.data;
    if (item.tag == kUsageHigh) return add_usages(usage_low_, item.data, item.size <= 2);
    return nullptr;
  }
  [[nodiscard]] const char* take_delimiter(bool opens) noexcept {
    if (opens == is_in_delimiter_) return opens ? "a delimiter within one" : "a delimiter's end";
    is_in_delimiter_ = opens;
    if (opens) ++delimiter_count_;
    return nullptr;
  }
  /// A range from a higher to a lower usage never ends, as in Linux.
  [[nodiscard]] const char* add_usages(std::uint32_t low, std::uint32_t high, bool is_short) {
    const std::uint32_t capacity = kUsageCountMax - usage_count_;
    if (capacity == 0) return "too many usages of a field";
    const std::uint32_t count = high - low < capacity ? high - low + 1 : capacity;
    usages_.push_back({is_short ? with_page(low, globals_.usage_page) : low, count, is_short});
    usage_count_ += count;
    return nullptr;
  }

  Globals globals_{};
  std::vector<Globals> stack_{};
  std::vector<std::uint32_t> collections_{};  ///< The application of each collection.
  std::vector<UsageRange> usages_{};
  std::uint32_t usage_count_ = 0;  ///< Counts the usages in all entries of usages_.
  std::uint32_t usage_low_ = 0;
  int delimiter_count_ = 0;
  bool is_in_delimiter_ = false;
  std::array<std::uint32_t, 256> input_bits_{};
  ReportDescriptor descriptor_{};
};

/// Removes the next item from `bytes`; nullopt if the item is truncated.
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
    if (bytes[0] == kLongItem) return unexpected{std::string("a long item")};
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
