#pragma once

#include <map>
#include <mutex>
#include <set>
#include <string>

#include "cli/context.hpp"
#include "rtpm/events/event.hpp"

namespace rtpm::tool {

/// Maps sources of events to devices. A device's source is a number made of its name.
/// @ownership refers to its context
/// @threads  any; care() one
class SourceNames {
 public:
  /// Asks the registry. If none answers, sources keep their numbers.
  explicit SourceNames(Context& context);

  /// Asks again if a source without a name has appeared since the last time.
  void care();
  /// "lab/arm0"; empty if it is not a device.
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
