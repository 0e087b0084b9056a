#include "recordings/sources.hpp"

#include <map>
#include <utility>

#include "devices/device_names.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/call_recorder.hpp"
#include "rtpm/capture/event_recorder.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

/// The events of a hub, and the descriptions of the devices that push some of them.
class HubSource final : public Source, private Subscription::Observer {
 public:
  HubSource(Context& context, recording::Recorder& recorder, capture::DeviceRecorder& devices)
      : context_(context), devices_(devices), events_(recorder, /*names_devices=*/true) {}

  /// @return whether it is open; if not, the error was reported
  bool open(const EventRequest& request, int& exit_code) {
    // The devices are named before their first events arrive.
    const auto unnamed = name_devices();
    subscription_ = Subscription::open(context_, request, *this, exit_code);
    if (subscription_ == nullptr) return false;
    if (unnamed) {
      rt::print_error("rtpm", "devices are recorded by number, not by name, and can't be played: " +
                                  unnamed->text());
    }
    return true;
  }
  void care() override {
    subscription_->care();
    if (events_.is_holding()) subscription_->learn_types();
    if (events_.take_new_unnamed()) static_cast<void>(name_devices());
    subscription_->with_types(
        [this](const events::HubTypes& types) { events_.attend(types.list()); });
    describe_new_devices();
  }
  void add_to(SourceCounts& counts) const override {
    counts.lost += subscription_ ? subscription_->lost_count() : lost_count_;
  }
  void end() override {
    care();
    lost_count_ = subscription_->lost_count();
    subscription_->end();
    subscription_->with_types(
        [this](const events::HubTypes& types) { events_.finish(types.list()); });
    subscription_.reset();
    describe_new_devices();
  }

 private:
  void on_event(const events::EventView& event, const events::EventDescriptor* type) override {
    events_.record(event, type);
  }
  void describe_new_devices() {
    for (const std::string& name : events_.take_new_devices()) {
      if (const auto described = devices_.describe(name); !described) {
        rt::print_error("rtpm", named(name, described.error()).text() +
                                    "; without its description it can't be played");
      }
    }
  }
  /// @return the reason why the names are unknown; nullopt if they are known
  std::optional<SetupError> name_devices() {
    const auto names = device_names(context_);
    if (!names) return names.error();
    events_.name_devices(*names);
    return std::nullopt;
  }

  Context& context_;
  capture::DeviceRecorder& devices_;
  capture::EventRecorder events_;
  std::unique_ptr<Subscription> subscription_{};
  std::uint64_t lost_count_ = 0;
};

/// The samples of polled devices.
class PollSource final : public Source {
 public:
  explicit PollSource(capture::DeviceRecorder& devices) : devices_(devices) {}

  void care() override {
    for (const auto& [name, count] : devices_.failed_counts()) {
      if (std::exchange(told_[name], true)) continue;
      rt::print_error("rtpm", printable(name) + ": a poll failed; the next ones may find it again");
    }
  }
  void end() override { devices_.stop(); }

 private:
  capture::DeviceRecorder& devices_;
  std::map<std::string, bool> told_{};
};

/// The calls of a server's objects.
class CallSource final : public Source {
 public:
  explicit CallSource(std::unique_ptr<capture::CallRecorder> calls) : calls_(std::move(calls)) {}

  void add_to(SourceCounts& counts) const override {
    const capture::CallRecorderStatus status = calls_->status();
    counts.lost += status.dropped_count;
    counts.calls += status.call_count;
    counts.omitted_payloads += status.omitted_payload_count;
    counts.unreadable_payloads += status.unreadable_count;
  }
  std::optional<SetupError> problem() const override {
    const auto problem = calls_->status().problem;
    return problem ? std::optional(SetupError{*problem}) : std::nullopt;
  }
  void end() override { calls_->stop(); }

 private:
  std::unique_ptr<capture::CallRecorder> calls_;
};

}  // namespace

Sources::Sources(Context& context, const SourceRequest& request, recording::Recorder& recorder)
    : context_(context),
      request_(request),
      recorder_(recorder),
      devices_(context.node(), recorder) {}

int Sources::open() {
  if (const int exit_code = open_calls(); exit_code != kDone) return exit_code;
  if (const int exit_code = poll_devices(); exit_code != kDone) return exit_code;
  // Calls alone make a recording, and so do devices alone if no hub answers.
  if (!request_.needs_hub()) {
    if (!request_.calls.empty()) return kDone;
    if (!request_.devices.empty() && !events::HubTypes::ask(context_.node(), request_.hub)) {
      return kDone;
    }
  }
  return open_hub();
}

// A server has one tap for all its objects.
int Sources::open_calls() {
  std::map<std::string, std::vector<std::string>> urls;
  for (const std::string& target : request_.calls) {
    const auto url = dynamic::url_of(context_.node(), context_.registry, target);
    if (!url) return context_.not_reached(url.error());
    const auto parts = wire::parse_url(*url);
    if (!parts) return context_.fail("'" + *url + "' is no URL", kMisused);
    urls[parts->authority()].push_back(*url);
  }
  for (const auto& [server, objects] : urls) {
    auto calls = capture::CallRecorder::open(recorder_, context_.node(), objects,
                                             context_.deadline.value_or(std::chrono::seconds{1}));
    if (!calls && calls.error().cause) return context_.not_reached(calls.error());
    if (!calls) return context_.fail(calls.error());
    list_.push_back(std::make_unique<CallSource>(std::move(*calls)));
  }
  return kDone;
}

int Sources::poll_devices() {
  if (request_.devices.empty()) return kDone;
  list_.push_back(std::make_unique<PollSource>(devices_));
  for (const std::string& name : request_.devices) {
    if (const auto polled = devices_.poll(name, request_.poll_rate_hz); !polled) {
      return context_.not_reached(named(name, with_similar_names(context_, name, polled.error())));
    }
  }
  return kDone;
}

int Sources::open_hub() {
  auto hub = std::make_unique<HubSource>(context_, recorder_, devices_);
  int exit_code = kDone;
  if (hub->open(request_, exit_code)) list_.push_back(std::move(hub));
  return exit_code;
}

void Sources::care() {
  for (const auto& source : list_)
    source->care();
}

SourceCounts Sources::counts() const {
  SourceCounts counts;
  for (const auto& source : list_)
    source->add_to(counts);
  return counts;
}

std::optional<SetupError> Sources::problem() const {
  for (const auto& source : list_) {
    if (auto problem = source->problem()) return problem;
  }
  return std::nullopt;
}

void Sources::end() {
  for (const auto& source : list_)
    source->end();
}

}  // namespace rtpm::tool
