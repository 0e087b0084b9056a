#include "rtpm/exports/scalars.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>
#include <utility>

#include "numbers.hpp"
#include "recorded_devices.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/schema/compile.hpp"
#include "sample_names.hpp"
#include "table_layout.hpp"

namespace rtpm::exports {
namespace {

using schema::BaseType;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kOffsetSize = sizeof(std::uint32_t);

/// "m/s" of "linear_m_per_s.x": by the last component that ends with a unit; else empty.
std::string unit_in(std::string_view path) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 21> kUnits{
      {{"_rad_per_s", "rad/s"},
       {"_m_per_s2", "m/s²"},
       {"_m_per_s", "m/s"},
       {"_newton_metre", "N m"},
       {"_newton", "N"},
       {"_kelvin", "K"},
       {"_celsius", "°C"},
       {"_volt", "V"},
       {"_ampere", "A"},
       {"_watt", "W"},
       {"_pascal", "Pa"},
       {"_percent", "%"},
       {"_byte", "B"},
       {"_bytes", "B"},
       {"_ns", "ns"},
       {"_us", "µs"},
       {"_ms", "ms"},
       {"_hz", "Hz"},
       {"_rad", "rad"},
       {"_s", "s"},
       {"_m", "m"}}};
  while (!path.empty()) {
    const std::size_t dot = path.rfind('.');
    std::string_view name = dot == std::string_view::npos ? path : path.substr(dot + 1);
    name = name.substr(0, name.find('['));
    for (const auto& [suffix, unit] : kUnits) {
      if (name.ends_with(suffix)) return std::string(unit);
    }
    path = dot == std::string_view::npos ? std::string_view() : path.substr(0, dot);
  }
  return {};
}

double number_at(BaseType type, const std::byte* at) noexcept {
  switch (type) {
    case BaseType::kFloat:
      return static_cast<double>(std::bit_cast<float>(load_le<std::uint32_t>(at)));
    case BaseType::kDouble:
      return std::bit_cast<double>(load_le<std::uint64_t>(at));
    case BaseType::kUint64:
      return static_cast<double>(load_le<std::uint64_t>(at));
    case BaseType::kBool:
      return integer_at(type, at) != 0 ? 1 : 0;
    default:
      return static_cast<double>(integer_at(type, at));
  }
}

double default_of(const Column& column) noexcept {
  const schema::Field& field = *column.field;
  if (column.is_in_struct || field.is_optional) return kNan;
  const BaseType type = column.type.base;
  if (type == BaseType::kFloat || type == BaseType::kDouble) return field.default_real;
  if (type == BaseType::kUint64) {
    return static_cast<double>(static_cast<std::uint64_t>(field.default_integer));
  }
  return static_cast<double>(field.default_integer);
}

ScalarField::Kind kind_of(const Column& column) noexcept {
  if (column.type.index) return ScalarField::Kind::kEnumeration;
  return column.type.base == BaseType::kBool ? ScalarField::Kind::kBool
                                             : ScalarField::Kind::kNumber;
}

}  // namespace

struct ScalarReader::Source {
  const schema::Model& model;
  std::string_view table;
};

/// The tables on the way to a field, in bytes that may be damaged.
class ScalarReader::Tables {
 public:
  explicit Tables(ConstBytes bytes) noexcept : bytes_(bytes) {}

  /// Opens the tables of `place`, of which the first `shared_depth` are open already. The last one
  /// is absent if nothing refers to it.
  /// @return   whether all of them are inside the bytes
  [[nodiscard]] bool open(const Place& place) noexcept {
    for (std::size_t i = place.shared_depth; i < place.depth; ++i) {
      std::optional<std::size_t> reference = 0;
      if (i > 0) {
        if (!find(i - 1, place.slots[i - 1], kOffsetSize, reference)) return false;
      }
      tables_[i] = {};
      if (reference && !open(i, *reference)) return false;
    }
    return true;
  }

  [[nodiscard]] bool is_open(std::size_t depth) const noexcept { return tables_[depth].size > 0; }

  /// Finds the first `size` bytes of a field; nullopt if it or its table is absent.
  /// @return   whether they are inside the table
  [[nodiscard]] bool find(std::size_t depth, std::uint16_t slot, std::size_t size,
                          std::optional<std::size_t>& at) const noexcept {
    at = std::nullopt;
    const Table& table = tables_[depth];
    const std::size_t entry = kOffsetSize + 2 * std::size_t{slot};
    if (table.size == 0 || entry + 2 > table.directory_size) return true;
    const std::size_t offset = load_le<std::uint16_t>(bytes_.data() + table.directory + entry);
    if (offset == 0) return true;
    if (offset < kOffsetSize || offset + size > table.size) return false;
    at = table.at + offset;
    return true;
  }

 private:
  struct Table {
    std::size_t at = 0;
    std::size_t size = 0;       ///< 0 if it is absent.
    std::size_t directory = 0;  ///< Its vtable.
    std::size_t directory_size = 0;
  };

  bool open(std::size_t depth, std::size_t reference) noexcept {
    if (bytes_.size() < kOffsetSize || reference > bytes_.size() - kOffsetSize) return false;
    const std::size_t at = reference + load_le<std::uint32_t>(bytes_.data() + reference);
    if (at > bytes_.size() - kOffsetSize) return false;
    const auto back = static_cast<std::int32_t>(load_le<std::uint32_t>(bytes_.data() + at));
    const std::int64_t directory = static_cast<std::int64_t>(at) - back;
    if (directory < 0 || static_cast<std::size_t>(directory) > bytes_.size() - kOffsetSize)
      return false;
    Table table{.at = at, .directory = static_cast<std::size_t>(directory)};
    table.directory_size = load_le<std::uint16_t>(bytes_.data() + table.directory);
    table.size = load_le<std::uint16_t>(bytes_.data() + table.directory + 2);
    const bool is_inside = table.directory_size >= kOffsetSize && table.directory_size % 2 == 0 &&
                           table.directory_size <= bytes_.size() - table.directory &&
                           table.size >= kOffsetSize && table.size <= bytes_.size() - at;
    if (is_inside) tables_[depth] = table;
    return is_inside;
  }

  ConstBytes bytes_;
  std::array<Table, kDepthMax> tables_{};
};

expected<ScalarReader, SetupError> ScalarReader::create(const Source& source,
                                                        const driver::Descriptor* device,
                                                        Form form) {
  const std::string what = "the values of " + printable(source.table) + " can't be read";
  const auto& objects = source.model.objects;
  const auto found = std::ranges::find(objects, source.table, &schema::Object::name);
  if (found == objects.end() || found->is_struct)
    return setup_error(what, "its schema has no such table");
  const auto table = static_cast<std::size_t>(found - objects.begin());
  const auto columns = columns_of(source.model, table);
  ScalarReader reader;
  const schema::Payload payload = schema::payload_of(source.model, table);
  if (form == Form::kWire && payload.struct_index)
    reader.struct_size_ = objects[*payload.struct_index].byte_size;
  for (const Column& column : columns.value_or(std::vector<Column>{})) {
    if (column.kind != Column::Kind::kNumber) continue;
    ColumnName name{column.name, ""};
    if (device != nullptr) name = name_by_device(*device, column.name);
    if (name.name.empty()) continue;
    if (!column.unit.empty()) name.unit = column.unit;
    if (name.unit.empty()) name.unit = unit_in(column.name);
    Place place{.type = static_cast<std::uint8_t>(column.type.base),
                .offset = static_cast<std::uint32_t>(column.offset),
                .absent = default_of(column)};
    if (column.slots.size() > kDepthMax) return setup_error(what, "its tables are nested too deep");
    place.depth = static_cast<std::uint8_t>(column.slots.size());
    std::ranges::copy(column.slots, place.slots.begin());
    if (!reader.places_.empty()) {
      const Place& before = reader.places_.back();
      const std::size_t depth_min = std::min(before.depth, place.depth);
      place.shared_depth = 1;
      while (place.shared_depth < depth_min &&
             before.slots[place.shared_depth - 1u] == place.slots[place.shared_depth - 1u])
        ++place.shared_depth;
    }
    reader.fields_.push_back({std::move(name.name), std::move(name.unit), kind_of(column)});
    reader.places_.push_back(place);
  }
  if (!columns || reader.fields_.size() > kFieldCountMax)
    return setup_error(what, "it has more than " + std::to_string(kFieldCountMax) + " values");
  return reader;
}

expected<ScalarReader, SetupError> ScalarReader::create(const recording::Schema& schema,
                                                        const driver::Descriptor* device,
                                                        Form form) {
  const std::string what = "the values of " + printable(schema.name) + " can't be read";
  if (schema.encoding != "flatbuffer")
    return setup_error(what, "its schema is in the encoding '" + printable(schema.encoding) + "'");
  const auto compiled = schema::compile_binary(
      {reinterpret_cast<const std::uint8_t*>(schema.data.data()), schema.data.size()}, schema.name);
  if (!compiled.model) return setup_error(what, printable(compiled.errors.front().message));
  return create(Source{*compiled.model, schema.name}, device, form);
}

expected<ScalarReader, SetupError> ScalarReader::create(const std::string& text,
                                                        std::string_view table,
                                                        const driver::Descriptor* device,
                                                        Form form) {
  const auto compiled = schema::compile_text(text, "schema");
  if (!compiled.model) {
    return setup_error("the values of " + printable(table) + " can't be read",
                       printable(compiled.errors.front().message));
  }
  return create(Source{*compiled.model, table}, device, form);
}

bool ScalarReader::read(ConstBytes payload, std::span<double> values) const noexcept {
  std::ranges::fill(values, kNan);
  if (values.size() < places_.size()) return false;
  if (struct_size_ > 0) {
    if (payload.size() != struct_size_) return false;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const Place& place = places_[i];
      values[i] = number_at(static_cast<BaseType>(place.type), payload.data() + place.offset);
    }
    return true;
  }
  Tables tables(payload);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Place& place = places_[i];
    const auto type = static_cast<BaseType>(place.type);
    const std::size_t last = place.depth - 1u;
    std::optional<std::size_t> at;
    if (!tables.open(place) ||
        !tables.find(last, place.slots[last], place.offset + size_of(type), at)) {
      std::ranges::fill(values, kNan);
      return false;
    }
    if (at) {
      values[i] = number_at(type, payload.data() + *at + place.offset);
    } else if (tables.is_open(last)) {
      values[i] = place.absent;
    }
  }
  return true;
}

const driver::Descriptor* device_of(const Devices& devices, const recording::FileReader& reader,
                                    const recording::Channel& channel) {
  const auto device = devices.find(capture::value_of(channel, capture::kDeviceKey));
  return device != devices.end() && has_samples(reader, channel) ? &device->second : nullptr;
}

}  // namespace rtpm::exports
