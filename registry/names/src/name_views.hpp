#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/names/watch.hpp"

namespace rtpm::names {

/// The names of several services as one: a name is told of once, however many have it.
/// @threads  one at a time
class NameViews {
 public:
  /// What a change at a service is to the whole.
  struct Told {
    std::optional<NameChange> change{};
    std::string duplicate{};  ///< A sentence: the name began to lead to different URLs.
  };
  [[nodiscard]] Told take(const std::string& service_url, NameChange change);
  /// The names that the service had, as it is no more.
  [[nodiscard]] std::vector<NameEntry> names_of(const std::string& service_url) const;

 private:
  using Entries = std::map<std::string, NameEntry>;  ///< By the URLs of services.
  std::map<std::string, Entries, std::less<>> names_{};
};

}  // namespace rtpm::names
