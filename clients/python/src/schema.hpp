#pragma once

#include <nanobind/nanobind.h>

#include <string>
#include <vector>

#include "codec.hpp"
#include "rtpm/rpc/interface.hpp"

namespace rtpm::python {

/// A service of a schema, as the runtime describes it.
struct Interface {
  std::vector<rpc::MethodDescriptor> methods{};
  std::string text{};
  std::string schema{};
  rpc::InterfaceDescriptor descriptor{};
};

/// A compiled schema: its layout for Python's classes, its codec, its services.
/// @ownership lives as long as Python refers to it; its interfaces refer to it
/// @threads   with the GIL
class Schema {
 public:
  /// @param text  a schema without includes, see schema::schema_text()
  /// @errors      raises ValueError: not a schema
  explicit Schema(const std::string& text);

  [[nodiscard]] nanobind::dict layout() const;
  [[nodiscard]] Codec& codec() noexcept { return codec_; }
  [[nodiscard]] const Codec& codec() const noexcept { return codec_; }
  [[nodiscard]] const schema::Service& service(std::size_t index) const {
    return codec_.model().services.at(index);
  }
  [[nodiscard]] const rpc::InterfaceDescriptor& interface(std::size_t index) const {
    return interfaces_.at(index).descriptor;
  }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  std::string text_;
  Codec codec_;
  std::vector<Interface> interfaces_;
};

void define_schema(nanobind::module_& module);

}  // namespace rtpm::python
