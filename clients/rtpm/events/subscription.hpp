#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <mutex>
#include <string>

#include "cli/context.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub_types.hpp"

namespace rtpm::tool {

/// Which events a command selects.
struct EventRequest {
  std::string hub{events::kHubPath};
  std::string filter = "all";
  std::uint32_t every_nth = 1;
  std::optional<Duration> time{};  ///< If unset, until Ctrl-C.
};

/// Adds --hub, --filter, --every and --for.
void add_event_options(CLI::App& command, EventRequest& request);

/// Passes the events that a request selects to an observer.
/// @ownership refers to its context and observer
/// @threads  one; the observer is called on the consumer's thread
class Subscription final : public events::EventHandler {
 public:
  class Observer {
   public:
    virtual ~Observer() = default;
    /// Handles one event; `type` is null until the hub has described it.
    virtual void on_event(const events::EventView& event, const events::EventDescriptor* type) = 0;
  };

  /// @return null after the error was reported, with its exit code in `exit_code`
  [[nodiscard]] static std::unique_ptr<Subscription> open(Context& context,
                                                          const EventRequest& request,
                                                          Observer& observer, int& exit_code);
  ~Subscription() override;

  /// Fetches new types, and reports losses and interruptions. Call it periodically.
  void care();
  [[nodiscard]] std::uint64_t lost_count() const;
  /// Passes on no more events. Do not call lost_count() afterwards.
  void end();

  void on_events(std::span<const events::EventView> events) override;
  void on_notice(const events::Notice& notice) override;

 private:
  Subscription(Context& context, std::string hub, Observer& observer,
               events::HubTypes types) noexcept;

  Context& context_;
  std::string hub_;
  Observer& observer_;
  std::mutex mutex_{};
  events::HubTypes types_;
  bool lacks_type_ = false;
  std::string notice_{};
  std::unique_ptr<events::Consumer> consumer_{};
};

}  // namespace rtpm::tool
