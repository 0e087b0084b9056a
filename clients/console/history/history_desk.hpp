#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "history/history.hpp"
#include "live/callbacks.hpp"
#include "parameters/parameter_desk.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/exports/scalars.hpp"
#include "services/call_router.hpp"

namespace rtpm::console {

/// Keeps the past of all numbers in the events that pass through the console, and of parameters,
/// and serves `console/fields` and `console/history`.
/// @ownership refers to the router
/// @threads  the web server's thread
class HistoryDesk {
 public:
  explicit HistoryDesk(CallRouter& router) noexcept : router_(router) {}

  void start();
  void set_types(std::shared_ptr<const events::HubTypes> types) { types_ = std::move(types); }
  /// Names the elements of the arrays in a device's samples, which are not kept before.
  void set_descriptor(const std::string& device,
                      std::shared_ptr<const driver::Descriptor> descriptor);
  /// @param device  the device that is the event's source; nullptr if none is known
  void take(const HubEvent& event, const std::string* device);
  void take_parameters(const std::string& object, const std::vector<NumericParameter>& parameters);
  /// Follows the wall clock. Call it a few times per second.
  void follow_clock(MonotonicTime now);
  /// The use of memory as JSON, for the page.
  [[nodiscard]] nlohmann::ordered_json state() const;

 private:
  using Reader = std::shared_ptr<const exports::ScalarReader>;
  /// How the events of a type and source are read.
  struct Plan {
    std::uint64_t schema_id = 0;
    std::shared_ptr<const driver::Descriptor> descriptor{};
    HistoryTopic topic{};
    Reader reader{};  ///< nullptr: the schema can't be read, or there is no room.
    MonotonicTime made{};
    std::vector<double> values{};
    std::optional<std::size_t> orientation{};  ///< Its first component; the direction follows.
    std::optional<std::size_t> force{};        ///< Its first component; the magnitude follows.
  };

  [[nodiscard]] Plan* plan_of(const HubEvent& event, const std::string* device);
  [[nodiscard]] Plan plan_for(const HubEvent& event, const events::EventDescriptor& type,
                              const std::string* device,
                              std::shared_ptr<const driver::Descriptor> descriptor);
  [[nodiscard]] Reader reader_of(const events::EventDescriptor& type,
                                 const driver::Descriptor* descriptor);
  void answer_fields(const PendingCall& call, const nlohmann::json& request);
  void answer_history(const PendingCall& call, const nlohmann::json& request);

  CallRouter& router_;
  History history_{};
  std::shared_ptr<const events::HubTypes> types_{};
  std::map<std::string, std::shared_ptr<const driver::Descriptor>> descriptors_{};
  std::map<std::pair<events::EventType, events::SourceId>, Plan> plans_{};
  std::map<events::EventType, std::pair<std::uint64_t, Reader>> readers_{};  ///< With schema ids.
};

}  // namespace rtpm::console
