#pragma once

#include <map>
#include <mutex>
#include <set>
#include <string>

#include "cli/context.hpp"
#include "rtpm/events/event.hpp"

namespace rtpm::tool {

/// Maps event sources to devices. A device's source is a number derived from its name.
/// @ownership refers to its context
/// @threads  any; care(): one
class SourceNames {
 public:
  /// Queries the registry. Without an answer, sources are shown as numbers.
  explicit SourceNames(Context& context);

  /// Queries again if a source without a name has appeared since the last query.
  void care();
  /// Such as "lab/arm0"; empty if the source is not a device.
  [[nodiscard]] std::string name_of(events::SourceId source);

 private:
  void learn();

  Context& context_;
  std::mutex mutex_{};
  std::map<events::SourceId, std::string> names_{};
  std::set<events::SourceId> unnamed_{};
  bool has_new_unnamed_ = false;
};

}  // namespace rtpm::tool
