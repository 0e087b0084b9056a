#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/names/watch.hpp"

namespace rtpm::names {

/// The names of several services as one view: a name is reported once, even if several services
/// have it.
/// @threads  one at a time
class NameViews {
 public:
  /// The meaning of a service's change for the combined view.
  struct Told {
    std::optional<NameChange> change{};
    std::string duplicate{};  ///< A sentence, if the name now leads to different URLs.
  };
  [[nodiscard]] Told take(const std::string& service_url, NameChange change);
  /// The names of a service, to report them as gone when it ends.
  [[nodiscard]] std::vector<NameEntry> names_of(const std::string& service_url) const;

 private:
  using Entries = std::map<std::string, NameEntry>;  ///< Keyed by the services' URLs.
  std::map<std::string, Entries, std::less<>> names_{};
};

}  // namespace rtpm::names
