#include "rtpm/events/scalar.hpp"

#include <bit>

namespace rtpm::events {
namespace {

struct ScalarFacts {
  std::string_view name;
  std::size_t size = 0;
  Scalar::Kind kind = Scalar::Kind::kSigned;
};

constexpr std::array<ScalarFacts, kScalarTypeCount> kFacts{{
    {"bool", 1, Scalar::Kind::kUnsigned},
    {"int8", 1, Scalar::Kind::kSigned},
    {"uint8", 1, Scalar::Kind::kUnsigned},
    {"int16", 2, Scalar::Kind::kSigned},
    {"uint16", 2, Scalar::Kind::kUnsigned},
    {"int32", 4, Scalar::Kind::kSigned},
    {"uint32", 4, Scalar::Kind::kUnsigned},
    {"int64", 8, Scalar::Kind::kSigned},
    {"uint64", 8, Scalar::Kind::kUnsigned},
    {"float", 4, Scalar::Kind::kReal},
    {"double", 8, Scalar::Kind::kReal},
}};

const ScalarFacts& facts_of(ScalarType type) noexcept {
  return kFacts[static_cast<std::size_t>(type)];
}

template <class T>
std::optional<T> load_at(ConstBytes bytes, std::uint64_t offset) noexcept {
  if (offset > bytes.size() || bytes.size() - offset < sizeof(T)) return std::nullopt;
  return load_le<T>(bytes.data() + offset);
}

template <class Unsigned, class Signed>
Scalar signed_of(Unsigned bits) noexcept {
  return Scalar::of(static_cast<std::int64_t>(static_cast<Signed>(bits)));
}

// The caller has checked the bounds.
Scalar decode(const std::byte* at, ScalarType type) noexcept {
  switch (type) {
    case ScalarType::kBool:
    case ScalarType::kUint8:
      return Scalar::of(std::uint64_t{load_le<std::uint8_t>(at)});
    case ScalarType::kInt8:
      return signed_of<std::uint8_t, std::int8_t>(load_le<std::uint8_t>(at));
    case ScalarType::kInt16:
      return signed_of<std::uint16_t, std::int16_t>(load_le<std::uint16_t>(at));
    case ScalarType::kUint16:
      return Scalar::of(std::uint64_t{load_le<std::uint16_t>(at)});
    case ScalarType::kInt32:
      return signed_of<std::uint32_t, std::int32_t>(load_le<std::uint32_t>(at));
    case ScalarType::kUint32:
      return Scalar::of(std::uint64_t{load_le<std::uint32_t>(at)});
    case ScalarType::kInt64:
      return signed_of<std::uint64_t, std::int64_t>(load_le<std::uint64_t>(at));
    case ScalarType::kUint64:
      return Scalar::of(load_le<std::uint64_t>(at));
    case ScalarType::kFloat:
      return Scalar::of(double{std::bit_cast<float>(load_le<std::uint32_t>(at))});
    case ScalarType::kDouble:
      break;
  }
  return Scalar::of(std::bit_cast<double>(load_le<std::uint64_t>(at)));
}

// The offset of a table's field; 0 if absent, nullopt if the table is malformed.
std::optional<std::uint64_t> field_of(ConstBytes bytes, std::uint64_t table,
                                      std::uint16_t slot) noexcept {
  const auto back = load_at<std::uint32_t>(bytes, table);
  if (!back) return std::nullopt;
  const std::int64_t vtable = static_cast<std::int64_t>(table) - static_cast<std::int32_t>(*back);
  if (vtable < 0) return std::nullopt;
  const auto vtable_size = load_at<std::uint16_t>(bytes, static_cast<std::uint64_t>(vtable));
  if (!vtable_size) return std::nullopt;
  const std::uint64_t entry = 4 + 2 * std::uint64_t{slot};
  if (entry + 2 > *vtable_size) return 0;
  const auto offset = load_at<std::uint16_t>(bytes, static_cast<std::uint64_t>(vtable) + entry);
  if (!offset) return std::nullopt;
  return *offset == 0 ? 0 : table + *offset;
}

}  // namespace

std::string_view to_string(ScalarType type) noexcept {
  return facts_of(type).name;
}
bool is_real(ScalarType type) noexcept {
  return facts_of(type).kind == Scalar::Kind::kReal;
}
bool is_signed(ScalarType type) noexcept {
  return facts_of(type).kind == Scalar::Kind::kSigned;
}
std::size_t size_of(ScalarType type) noexcept {
  return facts_of(type).size;
}

std::optional<Scalar> read_scalar(ConstBytes payload, const FieldPath& path, ScalarType type,
                                  const Scalar& default_value) noexcept {
  std::uint64_t at = 0;
  if (path.slot_count > 0) {
    for (std::uint8_t i = 0; i < path.slot_count; ++i) {
      // The root and tables are addressed by offsets relative to the offset itself.
      const auto step = load_at<std::uint32_t>(payload, at);
      if (!step) return std::nullopt;
      const auto field = field_of(payload, at + *step, path.slots[i]);
      if (!field) return std::nullopt;
      if (*field == 0) return default_value;
      at = *field;
    }
  }
  at += path.offset;
  if (at > payload.size() || payload.size() - at < size_of(type)) return std::nullopt;
  return decode(payload.data() + at, type);
}

}  // namespace rtpm::events
