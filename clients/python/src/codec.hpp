#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::python {

/// Converts a schema's payloads between wire bytes and objects of Python's classes. Structs are
/// buffers of their wire bytes (rtpm.Struct); tables are objects with one attribute per field.
/// @ownership holds the schema and its classes
/// @threads   with the GIL
class Codec {
 public:
  /// @errors raises ValueError: not a schema
  explicit Codec(const std::string& schema);

  [[nodiscard]] const schema::Model& model() const noexcept { return dynamic_->model(); }

  /// Sets the classes of Model::objects and Model::enums, in their order; None for an unused one.
  void set_classes(nanobind::list objects, nanobind::list enums);

  /// @errors raises TypeError or ValueError, with the field and what it takes
  [[nodiscard]] std::vector<std::byte> encode(const schema::Payload& payload,
                                              nanobind::handle value) const;
  /// @errors raises BadReply: the bytes do not match the schema
  [[nodiscard]] nanobind::object decode(const schema::Payload& payload, ConstBytes bytes) const;

  /// Why `bytes` are not a request of this type; empty if they are one. Checks `rtpm_range`, too.
  [[nodiscard]] std::string refusal(const schema::Payload& payload, ConstBytes bytes) const;

  /// The class of an object; its wire bytes as an object, for a struct.
  [[nodiscard]] nanobind::object class_of(std::size_t object) const;
  [[nodiscard]] nanobind::object struct_from(std::size_t object, ConstBytes bytes) const;

 private:
  std::unique_ptr<schema::Dynamic> dynamic_;
  nanobind::list objects_{};
  nanobind::list enums_{};
};

}  // namespace rtpm::python
