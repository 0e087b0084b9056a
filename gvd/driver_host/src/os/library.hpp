#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "rtpm/base/expected.hpp"
#include "rtpm/rt/crash.hpp"

namespace rtpm::driver_host {

/// A loaded shared library; crash reports name its code. Unloads the library on destruction.
/// @threads  any
class Library {
 public:
  /// Loads `file`; a bare name means a file in the working folder.
  /// @errors   in the system's words
  [[nodiscard]] static expected<std::shared_ptr<Library>, std::string> load(
      const std::string& file);
  Library(void* handle, std::string name) noexcept : handle_(handle), name_(std::move(name)) {}
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library();

  /// The exported symbol `name`; null if there is none.
  [[nodiscard]] const void* symbol(const char* name) const noexcept;
  /// Registers the library's code, which includes `symbol`, for crash reports.
  void name_code_around(const void* symbol);

 private:
  void* handle_;
  std::string name_;
  std::optional<rt::CodeName> code_name_{};
};

}  // namespace rtpm::driver_host
