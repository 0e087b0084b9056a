#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "live/callbacks.hpp"
#include "live/event_inbox.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/filter_text.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// The hub watch's reports, called on the web server's thread.
struct HubCallbacks {
  std::function<void(HubEvent)> on_event{};
  std::function<void(Standing)> on_standing{};
  std::function<void(std::shared_ptr<const events::HubTypes>)> on_types{};
};

/// Subscribes to a hub on behalf of all browsers, with four subscriptions regardless of the number
/// of devices and sources: all changes of devices, the samples of devices, trials, and events of
/// other types, of which the hub passes 60 per second for each source. Reconnects to a hub that is
/// absent, ends or restarts.
/// @ownership refers to its node
/// @threads  look() and set_log(): one each, blocking; set_devices() and end_log(): any; stop():
///           alone
class HubWatch {
 public:
  HubWatch(rpc::Node& node, std::string hub, Post post, HubCallbacks callbacks);
  HubWatch(const HubWatch&) = delete;
  HubWatch& operator=(const HubWatch&) = delete;
  ~HubWatch();

  void set_devices(std::vector<std::string> names);
  /// Creates and ends subscriptions as needed. Call it periodically.
  void look();

  /// Subscribes to the events that `filter` accepts, replacing the connection's previous filter.
  /// @errors  where and why the text is not a filter; offset 0 if there is no hub
  [[nodiscard]] expected<void, events::FilterTextError> set_log(std::uint64_t connection_id,
                                                                const std::string& filter);
  void end_log(std::uint64_t connection_id);
  /// The number of events dropped because the web server's thread was too busy.
  [[nodiscard]] std::uint64_t dropped_count() const { return inbox_.dropped_count(); }
  /// Ends all subscriptions; nothing is posted afterwards.
  void stop();

 private:
  class Tap;

  [[nodiscard]] bool open_main();
  void ask_types();
  void follow_devices();
  void open_others();
  void open_marks();
  [[nodiscard]] std::unique_ptr<Tap> open(EventStream stream, std::uint64_t connection_id,
                                          events::ConsumerConfig config, std::string* problem);
  void set_standing(bool is_ok, const std::string& problem);
  void deliver(HubEvent event);
  /// Hands over some events; the others follow after the web server's thread has done other work.
  void hand_over();

  rpc::Node& node_;
  std::string hub_;
  Post post_;
  HubCallbacks callbacks_;
  EventInbox inbox_{};
  std::mutex mutex_{};
  // Guarded by `mutex_`.
  std::vector<std::string> devices_{};
  std::set<std::uint64_t> ended_logs_{};
  std::shared_ptr<const events::HubTypes> types_{};
  bool lacks_type_ = false;
  bool is_lost_ = false;       ///< The main subscription has ended permanently.
  bool was_restored_ = false;  ///< The hub is back, perhaps with other types.
  // Used by look()'s thread only.
  MonotonicTime next_types_{};
  std::vector<std::string> followed_{};  ///< The devices of `samples_`.
  std::unique_ptr<Tap> main_;
  std::unique_ptr<Tap> samples_;
  std::unique_ptr<Tap> others_;
  std::unique_ptr<Tap> marks_;
  std::mutex log_mutex_{};
  std::map<std::uint64_t, std::unique_ptr<Tap>> logs_;  ///< Guarded by `log_mutex_`.
};

}  // namespace rtpm::console
