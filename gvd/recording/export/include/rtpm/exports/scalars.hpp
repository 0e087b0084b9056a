#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::exports {

/// One number of a message.
struct ScalarField {
  enum class Kind : std::uint8_t { kNumber, kBool, kEnumeration };
  /// "position_m.x", "joints.elbow", "pair.numbers[1]": the name of its column in tables. The field
  /// of a table that holds only one struct is left out: "position_m", not "sample.position_m".
  std::string path{};
  std::string unit{};  ///< "m", "N m": the schema's, the device's, or by the name; else empty.
  Kind kind = Kind::kNumber;
};

/// Reads all numbers of a message by its schema: those of structs, of tables inside tables, and of
/// arrays. Texts, vectors and unions are left out.
/// @ownership owns all its data
/// @threads  any, concurrently
class ScalarReader {
 public:
  /// The most fields of a message; a schema with more is refused.
  static constexpr std::size_t kFieldCountMax = 4096;

  /// How a payload is encoded.
  enum class Form : std::uint8_t {
    kTable,  ///< A FlatBuffer whose root is the table: in recordings, and in a console's channels.
    kWire,   ///< As in an event: a table that holds only one struct is the bare struct.
  };

  /// @param schema  the bytes of a recorded schema, "flatbuffer"
  /// @param device  the parts of this device name the elements of its samples' arrays; nullptr: the
  ///                elements have numbers
  /// @errors   not a FlatBuffers schema, or one without the table; too many fields
  /// @realtime set-up only
  [[nodiscard]] static expected<ScalarReader, SetupError> create(
      const recording::Schema& schema, const driver::Descriptor* device = nullptr,
      Form form = Form::kTable);
  /// @param text  a schema's text without includes, such as EventDescriptor::schema
  /// @param table  its table, such as the event's name
  /// @errors   as above
  [[nodiscard]] static expected<ScalarReader, SetupError> create(
      const std::string& text, std::string_view table, const driver::Descriptor* device = nullptr,
      Form form = Form::kTable);

  [[nodiscard]] std::span<const ScalarField> fields() const noexcept { return fields_; }

  /// Reads a message into one value for each field. An absent field has its default, or NaN if it
  /// has none; true is 1. Integers above 2^53 are rounded. Every access is checked, so a message
  /// may come from any program.
  /// @param values  as many as fields()
  /// @return   whether the payload matches the schema; if not, all values are NaN
  /// @realtime alloc-free, bounded by the number of fields
  bool read(ConstBytes payload, std::span<double> values) const noexcept;

 private:
  /// The most tables inside each other.
  static constexpr std::size_t kDepthMax = 16;

  struct Place {
    std::array<std::uint16_t, kDepthMax> slots{};
    std::uint8_t depth = 0;         ///< The number of slots.
    std::uint8_t shared_depth = 0;  ///< How many tables are those of the field before.
    std::uint8_t type = 0;          ///< A schema::BaseType.
    std::uint32_t offset = 0;       ///< In the struct of the last slot, in bytes.
    double absent = 0;              ///< The value if the table lacks it.
  };
  class Tables;
  struct Source;

  [[nodiscard]] static expected<ScalarReader, SetupError> create(const Source& source,
                                                                 const driver::Descriptor* device,
                                                                 Form form);

  std::vector<ScalarField> fields_{};
  std::vector<Place> places_{};
  std::size_t struct_size_ = 0;  ///< The size of a bare struct; 0 for a FlatBuffer.
};

/// Descriptors by the device's name.
using Devices = std::map<std::string, driver::Descriptor>;

/// The devices that the recording describes; those of another version of RTPM's schema are left
/// out.
/// @errors   those of FileReader::read()
/// @realtime never
[[nodiscard]] expected<Devices, SetupError> read_devices(recording::FileReader& reader,
                                                         const recording::Progress& progress = {});

/// The device whose samples the channel has, of this version of RTPM's schema; nullptr if there is
/// none.
[[nodiscard]] const driver::Descriptor* device_of(const Devices& devices,
                                                  const recording::FileReader& reader,
                                                  const recording::Channel& channel);

}  // namespace rtpm::exports
